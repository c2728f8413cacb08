//! What is shown and in which colours: the display settings, kept with the window and not with the scene.

use serde::{Deserialize, Serialize};

/// A display colour: red, green and blue as on the screen.
pub type Colour = [u8; 3];

/// Dark or light surroundings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Theme {
    /// Light cloth on dark grey.
    #[default]
    Dark,
    /// For print and for bright rooms.
    Light,
}

/// Every colour of the viewport that a user can edit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Colours {
    /// The side of the cloth from which its faces run counter-clockwise.
    pub front: Colour,
    /// The other side.
    pub back: Colour,
    /// Edges of the faces.
    pub edges: Colour,
    /// Springs by kind: stretch, shear, bend.
    pub springs: [Colour; 3],
    /// Free particles.
    pub particle: Colour,
    /// Pinned particles.
    pub pinned: Colour,
    /// Particles held by the mouse.
    pub grabbed: Colour,
    /// Particles of the selection.
    pub selected: Colour,
}

impl Default for Colours {
    fn default() -> Self {
        Self {
            front: [88, 138, 196],
            back: [204, 122, 92],
            edges: [16, 24, 38],
            springs: [[86, 196, 98], [226, 82, 76], [240, 200, 66]],
            particle: [214, 220, 230],
            pinned: [255, 122, 48],
            grabbed: [255, 255, 255],
            selected: [80, 220, 255],
        }
    }
}

/// The display settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[allow(clippy::struct_excessive_bools)]
pub struct Style {
    /// Surroundings.
    pub theme: Theme,
    /// The lit surface.
    pub surface: bool,
    /// The edges of the faces on it.
    pub edges: bool,
    /// Springs by kind: stretch, shear, bend.
    pub springs: [bool; 3],
    /// Free particles; pinned, grabbed and selected ones are always shown.
    pub particles: bool,
    /// Radius of a particle as a part of the mean edge length.
    pub particle_size: f32,
    /// Width of springs, points (1/96 inch on an ordinary screen).
    pub line_width: f32,
    /// Colour the surface by the values that come with the frame (strain, or distance between lanes).
    pub surface_values: bool,
    /// Colour the springs by their strain.
    pub spring_strain: bool,
    /// Strain or value that gets the last colour of the ramp; its negative gets the first.
    pub value_range: f32,
    /// The colours of values on the surface.
    #[serde(skip)]
    pub ramp: Ramp,
    /// Ground grid.
    pub ground: bool,
    /// Coloured x and z axes on the ground.
    pub axes: bool,
    /// Soft shadow on the ground.
    pub shadow: bool,
    /// Free particles drawn at most; of more, every n-th is drawn.
    pub particle_limit: u32,
    /// Springs of a kind drawn at most; of more, every n-th is drawn.
    pub spring_limit: u32,
    /// Colours.
    pub colours: Colours,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            theme: Theme::Dark,
            surface: true,
            edges: true,
            springs: [false; 3],
            particles: true,
            particle_size: 0.09,
            line_width: 1.6,
            surface_values: false,
            spring_strain: false,
            value_range: 0.2,
            ramp: Ramp::Strain,
            ground: true,
            axes: true,
            shadow: true,
            particle_limit: 40_000,
            spring_limit: 200_000,
            colours: Colours::default(),
        }
    }
}

/// What values are, and so how they are coloured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ramp {
    /// Signed: from compressed through unstrained to stretched.
    #[default]
    Strain,
    /// From nothing upwards: brighter is more.
    Distance,
}

impl Ramp {
    /// The stops from -1 to 1.
    pub fn stops(self) -> [Colour; 7] {
        match self {
            Self::Strain => STRAIN_RAMP,
            Self::Distance => {
                let [a, b, c, d] = DISTANCE_RAMP;
                [a, a, a, a, b, c, d]
            }
        }
    }

    /// The colour at `value` between -1 and 1, mixed as the shaders mix it.
    pub fn colour(self, value: f32) -> Colour {
        let stops = self.stops();
        let last = stops.len() - 1;
        let place = f32::midpoint(value.clamp(-1.0, 1.0), 1.0) * last as f32;
        let stop = (place as usize).min(last - 1);
        let part = place - stop as f32;
        std::array::from_fn(|i| {
            let (a, b) = (f32::from(stops[stop][i]), f32::from(stops[stop + 1][i]));
            (a + (b - a) * part).round() as u8
        })
    }
}

/// Stops of the sequential ramp from 0 to 1.
const DISTANCE_RAMP: [Colour; 4] = [[86, 84, 150], [150, 62, 150], [230, 98, 88], [252, 232, 150]];

/// Stops of the diverging ramp from compressed through unstrained to stretched; the legend and the shaders both read it.
pub const STRAIN_RAMP: [Colour; 7] = [
    [44, 92, 240],
    [84, 150, 246],
    [164, 206, 246],
    [228, 228, 224],
    [250, 192, 112],
    [244, 114, 62],
    [218, 32, 54],
];

/// A display colour as the shaders' four numbers between 0 and 1.
pub(super) fn rgba(colour: Colour) -> [f32; 4] {
    let [r, g, b] = colour.map(|c| f32::from(c) / 255.0);
    [r, g, b, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_is_neutral_at_rest_and_clamps_at_its_ends() {
        assert_eq!(Ramp::Strain.colour(0.0), STRAIN_RAMP[3]);
        assert_eq!(Ramp::Strain.colour(-9.0), STRAIN_RAMP[0]);
        assert_eq!(Ramp::Strain.colour(9.0), STRAIN_RAMP[6]);
    }

    #[test]
    fn a_style_file_may_leave_everything_out() {
        assert_eq!(ron::from_str::<Style>("()").expect("every field has a default"), Style::default());
    }
}
