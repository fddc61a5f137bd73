//! (room)
use super::build::Builder;
use crate::Scene;
pub(super) fn room() -> Scene {
    Builder::new("room").done()
}
