//! Colours that can be distinguished with all common kinds of colour blindness, and in greyscale.

/// Red, green and blue, 0 to 255.
pub type Colour = [u8; 3];

/// Lines and branches: the colours of Okabe and Ito without yellow, which is too light for white paper.
pub const LINES: [Colour; 7] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0xe6, 0x9f, 0x00],
    [0x56, 0xb4, 0xe9],
    [0x00, 0x00, 0x00],
];

/// Text and axes.
pub(super) const INK: Colour = [0x1a, 0x1a, 0x1a];

/// The colour scale of a field, from the smallest value to the largest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shades(&'static [u32; 17]);

/// Purple over green to yellow, for speeds and stresses.
pub const VIRIDIS: Shades = Shades(&[
    0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c, 0x1fa088,
    0x28ae80, 0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725,
]);

/// Blue over grey to yellow, for contact pressures.
pub const CIVIDIS: Shades = Shades(&[
    0x00224e, 0x002e6a, 0x1a386f, 0x32436d, 0x434e6c, 0x535a6d, 0x61656f, 0x6f7073, 0x7d7c78, 0x8c8878,
    0x9b9476, 0xaba072, 0xbcae6c, 0xcdbb63, 0xdec958, 0xf0d846, 0xfee838,
]);

/// Number of different shades in a picture.
const LEVELS: f64 = 96.0;

impl Shades {
    /// The shade at a share from 0 to 1 of the range.
    pub fn at(&self, share: f64) -> Colour {
        let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
        let along = f64::from(nearest(share * LEVELS)) / LEVELS * 16.0;
        let below = (along as usize).min(15);
        let part = along - below as f64;
        let channel = |anchor: u32, shift: u32| f64::from((anchor >> shift) & 0xff);
        [16, 8, 0].map(|shift| {
            let (low, high) = (channel(self.0[below], shift), channel(self.0[below + 1], shift));
            nearest(low + part * (high - low))
        })
    }
}

/// A colour in SVG and HTML notation.
pub fn hex([red, green, blue]: Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// A light version of a colour, for backgrounds.
pub fn lightened(colour: Colour) -> Colour {
    colour.map(|channel| 0xff - nearest(f64::from(0xff - channel) * 0.17))
}

/// A darker colour.
pub(super) fn dimmed(colour: Colour, light: f64) -> Colour {
    if light == 1.0 { colour } else { colour.map(|channel| nearest(f64::from(channel) * light)) }
}

/// The integer nearest to a number from 0 to 255. Where the processor's instruction may not be used, `round` is a function that takes longer
/// than the rest of a sample.
fn nearest(number: f64) -> u8 {
    (number + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Approximate perceived lightness.
    fn lightness([r, g, b]: Colour) -> f64 {
        0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
    }

    #[test]
    fn shades_grow_lighter_so_that_they_are_read_without_colour() {
        for shades in [VIRIDIS, CIVIDIS] {
            let light: Vec<f64> = (0..=20).map(|n| lightness(shades.at(f64::from(n) / 20.0))).collect();
            assert!(light.windows(2).all(|pair| pair[0] < pair[1]), "{light:?}");
        }
    }

    #[test]
    fn each_line_has_a_light_background_of_its_own() {
        let light = LINES.map(lightened);
        for (at, colour) in light.iter().enumerate() {
            assert!(lightness(*colour) > 200.0 && !light[..at].contains(colour), "{colour:?}");
        }
    }

    #[test]
    fn the_ends_hold_beyond_the_range() {
        assert_eq!(hex(VIRIDIS.at(-1.0)), "#440154");
        assert_eq!(hex(VIRIDIS.at(2.0)), "#fde725");
        assert_eq!(VIRIDIS.at(f64::NAN), VIRIDIS.at(0.0));
    }
}
