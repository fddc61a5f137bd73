//! Visibility by rays: occlusion of segments and closest hits, over an obvhs tree.
