//! The brightness bounds that the error oracle weighs links by.

use crate::element::{ElementId, Forest};

use super::brightness::Brightness;
use super::margin::Shift;

/// Canonical brightness of all coarse elements and punctual lights: a pure function of the scene at one instant, never of the
/// running solution, so that verdicts do not depend on history.
#[derive(Clone, Debug, Default)]
pub struct CoarseBrightness {
    coarse: Vec<Brightness>,
    lights: Vec<f64>,
    reference_area_m2: f64,
}

/// Changes of canonical brightness; `None` where there is none.
#[derive(Clone, Debug, Default)]
pub struct BrightnessShifts {
    /// That of each coarse element, by number.
    pub coarse: Vec<Option<Shift>>,
    /// That of each punctual light.
    pub lights: Vec<Option<Shift>>,
}

impl CoarseBrightness {
    /// From the brightness of each coarse element, the mean intensity of each punctual light, and the area below which
    /// elements weigh less than others, m2. Values are rounded down to 1, 1.5, 2, 3, 4 ..., so that they seldom change.
    pub fn new(
        coarse: Vec<Brightness>,
        lights: Vec<f64>,
        reference_area_m2: f64,
    ) -> CoarseBrightness {
        let step = |l: Brightness| Brightness {
            radiosity: coarsen(l.radiosity),
            reflected: coarsen(l.reflected),
            irradiance: coarsen(l.irradiance),
        };
        CoarseBrightness {
            coarse: coarse.into_iter().map(step).collect(),
            lights: lights.into_iter().map(coarsen).collect(),
            reference_area_m2,
        }
    }

    /// Whether there are no coarse elements.
    pub fn is_empty(&self) -> bool {
        self.coarse.is_empty()
    }

    /// Whether that of all coarse elements is known ([`CoarseBrightness::renumber`]).
    pub fn is_known(&self) -> bool {
        !self.coarse.contains(&Brightness::UNKNOWN)
    }

    /// Brightness of an element or punctual light.
    #[inline]
    pub fn of(&self, forest: &Forest, id: ElementId) -> Brightness {
        if let Some(light) = forest.light(id) {
            let radiosity = self.lights[light];
            return Brightness { radiosity, reflected: 0.0, irradiance: f64::INFINITY };
        }
        forest.coarse(id).map_or(Brightness::UNIFORM, |c| self.coarse[c])
    }

    /// Changes since `before`.
    pub fn shifts(&self, before: &CoarseBrightness) -> BrightnessShifts {
        let elements = before.coarse.iter().zip(&self.coarse);
        let lights = before.lights.iter().zip(&self.lights);
        BrightnessShifts {
            coarse: elements.map(|(before, after)| Shift::between(before, after)).collect(),
            lights: lights.map(|(&before, &after)| Shift::of_light(before, after)).collect(),
        }
    }

    /// Renumbers coarse elements; `old_of` holds the old number of each. Of what had none, or several, no margin withstands the
    /// next change ([`Brightness::UNKNOWN`]).
    pub fn renumber(&mut self, old_of: &[Option<usize>]) {
        let of = |old: &Option<usize>| old.map_or(Brightness::UNKNOWN, |old| self.coarse[old]);
        self.coarse = old_of.iter().map(of).collect();
    }

    /// Area at which an element weighs 1 in the error norm, m2.
    pub fn reference_area_m2(&self) -> f64 {
        self.reference_area_m2
    }
}

/// Rounds down to 1, 1.5, 2, 3, 4, 6, 8 ...: all but the first bit of the mantissa is dropped.
pub fn coarsen(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & !((1 << 51) - 1))
}

#[cfg(test)]
mod tests {
    use super::super::margin::{Growth, Margin};
    use super::*;

    #[test]
    fn no_margin_withstands_the_next_change_of_an_element_that_had_no_number() {
        let uniform = |count| CoarseBrightness::new(vec![Brightness::UNIFORM; count], vec![], 1.0);
        let mut before = uniform(1);
        assert!(before.is_known());
        before.renumber(&[Some(0), None]);
        assert!(!before.is_known());
        // Equal to what any constant in place of the unknown would be.
        let shifts = uniform(2).shifts(&before).coarse;
        assert_eq!(shifts[0], None);
        let shift = shifts[1].expect("what was unknown has changed");
        let growth = Growth::of_pair(&shift, &Shift::default());
        for both_ways in [false, true] {
            let link = Margin::Link { on: [Margin::ENDLESS - 1; 2], both_ways };
            assert_eq!(link.after(&growth), None);
        }
        for is_link in [false, true] {
            assert_eq!(Margin::of_error(is_link, Margin::ENDLESS - 1).after(&growth), None);
        }
    }

    #[test]
    fn rounding_keeps_half_powers_of_two() {
        for (x, y) in [(1.0, 1.0), (1.4, 1.0), (1.5, 1.5), (1.99, 1.5), (5.9, 4.0), (0.0, 0.0)] {
            assert_eq!(coarsen(x), y);
        }
        assert!(coarsen(f64::INFINITY).is_infinite());
    }
}
