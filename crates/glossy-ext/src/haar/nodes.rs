//! Nodes of the tree of triangles, packed in as few bytes as the indices of a distribution need.

/// A node, its fields at the high end of a word: four bits that tell which children have a node, three vertex indices, and the
/// index of the first child's node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    word: u64,
    layout: Layout,
}

impl Node {
    /// No midpoint is the first corner of the octahedron.
    pub(super) const NO_VERTEX: u16 = 0;
    /// Nothing is known beyond an undivided triangle's corners.
    pub(super) const NONE: Self = Self { word: 0, layout: Layout { index: 1, node: 1 } };

    #[inline]
    pub(super) fn mids(self) -> [u16; 3] {
        let width = u32::from(self.layout.index);
        let low = (1 << width) - 1;
        // Turned by as much as the field is wide, its bits are the lowest.
        let a = self.word.rotate_left(4 + width);
        let b = a.rotate_left(width);
        [a, b, b.rotate_left(width)].map(|turned| turned as u16 & low)
    }

    /// Whether this stands for four triangles rather than for an undivided one with some finer neighbours.
    #[inline]
    pub(super) fn is_divided(self) -> bool {
        self.mids().iter().all(|&mid| mid != Self::NO_VERTEX)
    }

    /// Bit c: child c has a node.
    #[inline]
    pub(super) fn mask(self) -> u8 {
        (self.word >> 60) as u8
    }

    #[inline]
    pub(super) fn is_childless(self) -> bool {
        self.mask() == 0
    }

    /// Index of the first child's node, where there is one.
    #[inline]
    pub(super) fn base(self) -> usize {
        let above = 4 + 3 * u32::from(self.layout.index);
        (self.word << above >> (above + self.layout.unused())) as usize
    }

    /// How many children have a node.
    #[inline]
    pub(super) fn children(self) -> usize {
        self.mask().count_ones() as usize
    }

    /// Index of a child's node.
    #[inline]
    pub(super) fn child(self, child: usize) -> Option<usize> {
        let mask = usize::from(self.mask());
        if mask >> child & 1 == 0 {
            return None;
        }
        // How many of the up to three children before this one have a node: popcounts of 0…7, two bits each.
        const COUNTS: usize = 0b11_10_10_01_10_01_01_00;
        let before = mask & ((1 << child) - 1);
        Some(self.base() + (COUNTS >> (2 * before) & 3))
    }
}

/// What a node consists of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields {
    /// Bit c: child c has a node.
    pub(super) mask: u8,
    /// Vertices in the middle of the edges opposite each corner, or [`Node::NO_VERTEX`].
    pub(super) mids: [u16; 3],
    /// Index of the first child's node; 0 where there is none.
    pub(super) base: usize,
}

/// How the nodes of a distribution are packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Layout {
    /// Bits of the index of a vertex, at most 15.
    index: u8,
    /// Bytes of a node, at most 8.
    node: u8,
}

/// Bytes that are read at a time.
const WORD: usize = size_of::<u64>();

impl Layout {
    /// The shortest for so many vertices and nodes, both fewer than 2¹⁵.
    pub(super) fn new(vertices: usize, nodes: usize) -> Self {
        let bits = |count: usize| usize::BITS - count.leading_zeros();
        let index = bits(vertices - 1);
        Self { index: index as u8, node: (4 + 3 * index + bits(nodes.saturating_sub(1))).div_ceil(8) as u8 }
    }

    /// Low bits of a word that belong to the node before.
    #[inline]
    fn unused(self) -> u32 {
        64 - 8 * u32::from(self.node)
    }

    /// Packs nodes.
    pub(super) fn pack(self, nodes: &[Fields]) -> Box<[u8]> {
        if nodes.is_empty() {
            return Box::default();
        }
        let unused = WORD - usize::from(self.node);
        let mut bytes = vec![0; unused];
        for &Fields { mask, mids, base } in nodes {
            let fields = mids.iter().fold(u64::from(mask), |word, &mid| word << self.index | u64::from(mid));
            let word = fields << (60 - 3 * u32::from(self.index)) | (base as u64) << self.unused();
            bytes.extend_from_slice(&word.to_le_bytes()[unused..]);
        }
        bytes.into_boxed_slice()
    }

    /// How many nodes there are in an array, if it can be one.
    pub(super) fn count(self, bytes: &[u8]) -> Option<usize> {
        if bytes.is_empty() {
            return Some(0);
        }
        let node = usize::from(self.node);
        let packed = (bytes.len() + node).checked_sub(WORD)?;
        packed.is_multiple_of(node).then(|| packed.checked_div(node)).flatten()
    }

    /// A node of an array.
    #[inline]
    pub(super) fn node(self, bytes: &[u8], index: usize) -> Node {
        let at = index * usize::from(self.node);
        let word = bytes.get(at..at + WORD).and_then(|word| word.try_into().ok()).map_or(0, u64::from_le_bytes);
        Node { word, layout: self }
    }
}
