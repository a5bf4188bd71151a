//! Twines between neighbouring junctions in the picture.

/// What is known of a twine between two neighbouring nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TwineState {
    /// The picture does not tell.
    #[default]
    Unknown,
    /// There.
    Present,
    /// Gone, or broken, for certain: together with what else looks gone around it.
    Missing,
    /// Looks gone, as some of a picture's thousands of twines do by chance. More pictures tell.
    Doubtful,
    /// Behind a fish or another object.
    Hidden,
    /// Overgrown.
    Fouled,
}

impl TwineState {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Unknown, Self::Present, Self::Missing, Self::Doubtful, Self::Hidden, Self::Fouled];

    /// The word used in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Present => "present",
            Self::Missing => "missing",
            Self::Doubtful => "doubtful",
            Self::Hidden => "hidden",
            Self::Fouled => "fouled",
        }
    }
}

/// A twine with the evidence for its state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twine {
    /// Node at its first end.
    pub index: (i32, i32),
    /// 0: to node `(i + 1, j)`, 1: to `(i, j + 1)`.
    pub direction: usize,
    /// What is known of it.
    pub state: TwineState,
    /// Log likelihood ratio, present to missing.
    pub llr: f32,
    /// How many standard deviations the neighbourhood's twines stand out from the control lines.
    pub contrast: f32,
    /// Apparent width between the knots, px: the area of picture that it covers, growth included, over its length. Blur widens thin twine, and half a mesh is not looked beyond. `None`
    /// where there is none to be measured, or where it stands out too little.
    pub width_px: Option<f32>,
}

impl Twine {
    /// Node at its other end.
    pub fn end(&self) -> (i32, i32) {
        let (i, j) = self.index;
        if self.direction == 0 { (i.saturating_add(1), j) } else { (i, j.saturating_add(1)) }
    }
}
