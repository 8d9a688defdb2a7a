//! Perez's function of five parameters, from turbidity (with colours) and from irradiances.
//!
//! Sources: A. Preetham, P. Shirley, B. Smits: A practical analytic model for daylight, SIGGRAPH 1999, appendix;
//! R. Perez, R. Seals, J. Michalsky: All-weather model for sky luminance distribution, Solar Energy 50(3), 1993,
//! table 1, and its erratum, 51(5).

use std::f64::consts::PI;

use glam::DVec3;

/// Relative radiance (1 + a e^(b / cos zenith)) (1 + c e^(d gamma) + e cos^2 gamma), gamma being the angle from the sun.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distribution {
    parameters: [f64; 5],
}

impl Distribution {
    pub(super) fn at(&self, direction: DVec3, sun: DVec3) -> f64 {
        self.value(direction.y, direction.dot(sun).clamp(-1.0, 1.0))
    }

    /// By the cosines of the angles from the zenith and from the sun.
    fn value(&self, up: f64, to_sun: f64) -> f64 {
        let [a, b, c, d, e] = self.parameters;
        let gradation = 1.0 + a * libm::exp(b / up.max(HORIZON));
        gradation * (1.0 + c * libm::exp(d * libm::acos(to_sun)) + e * to_sun * to_sun)
    }
}

/// Luminous efficacy of the light of clear skies, lm/W (Perez et al. 1990 find 110 to 140): what turns the
/// luminance of Preetham's model into radiance.
pub const LUMENS_PER_WATT: f64 = 125.0;

/// The smallest cosine of the angle from the zenith at which gradations are evaluated.
pub(super) const HORIZON: f64 = 0.01;

/// A sky with colours at one instant.
#[derive(Clone, Debug)]
pub(super) struct Coloured {
    /// Of luminance, and of the chromaticities x and y.
    distributions: [Distribution; 3],
    /// The same at the zenith (luminance in cd/m2), over the value of the distribution there.
    scales: [f64; 3],
}

impl Coloured {
    /// W/m2/sr, linear RGB (sRGB's primaries).
    pub(super) fn radiance(&self, direction: DVec3, sun: DVec3) -> [f64; 3] {
        let value = |k: usize| self.scales[k] * self.distributions[k].at(direction, sun);
        let (luminance, x, y) = (value(0).max(0.0), value(1), value(2));
        if luminance <= 0.0 || y <= 0.0 {
            return [0.0; 3];
        }
        let radiance = luminance / LUMENS_PER_WATT;
        let xyz = [radiance * x / y, radiance, radiance * (1.0 - x - y) / y];
        // IEC 61966-2-1. Colours out of the gamut lose what is below nothing.
        let to_rgb =
            [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        to_rgb.map(|row| (0..3).map(|k| row[k] * xyz[k]).sum::<f64>().max(0.0))
    }
}

/// Preetham's sky of a turbidity with the sun at an angle from the zenith, radians; none while the sun is down.
pub(super) fn preetham(turbidity: f64, sun: f64) -> Coloured {
    let linear = |slope: [f64; 5], constant: [f64; 5]| Distribution {
        parameters: std::array::from_fn(|k| slope[k] * turbidity + constant[k]),
    };
    let distributions = [
        linear(
            [0.1787, -0.3554, -0.0227, 0.1206, -0.0670],
            [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703],
        ),
        linear(
            [-0.0193, -0.0665, -0.0004, -0.0641, -0.0033],
            [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452],
        ),
        linear(
            [-0.0167, -0.0950, -0.0079, -0.0441, -0.0109],
            [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529],
        ),
    ];
    let chi = (4.0 / 9.0 - turbidity / 120.0) * (PI - 2.0 * sun);
    let kcd = (4.0453 * turbidity - 4.9710) * libm::tan(chi) - 0.2155 * turbidity + 2.4192;
    let chromaticity = |of: [[f64; 4]; 3]| {
        let cubic = |c: [f64; 4]| ((c[0] * sun + c[1]) * sun + c[2]) * sun + c[3];
        (cubic(of[0]) * turbidity + cubic(of[1])) * turbidity + cubic(of[2])
    };
    let x = chromaticity([
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]);
    let y = chromaticity([
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]);
    let is_day = sun < 0.5 * PI;
    let zenith = [if is_day { (1000.0 * kcd).max(0.0) } else { 0.0 }, x, y];
    let scales = std::array::from_fn(|k| zenith[k] / distributions[k].value(1.0, libm::cos(sun)));
    Coloured { distributions, scales }
}

/// Clearnesses at which one row of [`ALL_WEATHER`] ends and the next begins.
const CLEARNESSES: [f64; 7] = [1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2];

/// Rows by clearness: a, b, c, d and e, four numbers each.
const ALL_WEATHER: [[[f64; 4]; 5]; 8] = [
    [
        [1.3525, -0.2576, -0.2690, -1.4366],
        [-0.7670, 0.0007, 1.2734, -0.1233],
        [2.8000, 0.6004, 1.2375, 1.0000],
        [1.8734, 0.6297, 0.9738, 0.2809],
        [0.0356, -0.1246, -0.5718, 0.9938],
    ],
    [
        [-1.2219, -0.7730, 1.4148, 1.1016],
        [-0.2054, 0.0367, -3.9128, 0.9156],
        [6.9750, 0.1774, 6.4477, -0.1239],
        [-1.5798, -0.5081, -1.7812, 0.1080],
        [0.2624, 0.0672, -0.2190, -0.4285],
    ],
    [
        [-1.1000, -0.2515, 0.8952, 0.0156],
        [0.2782, -0.1812, -4.5000, 1.1766],
        [24.7219, -13.0812, -37.7000, 34.8438],
        [-5.0000, 1.5218, 3.9229, -2.6204],
        [-0.0156, 0.1597, 0.4199, -0.5562],
    ],
    [
        [-0.5484, -0.6654, -0.2672, 0.7117],
        [0.7234, -0.6219, -5.6812, 2.6297],
        [33.3389, -18.3000, -62.2500, 52.0781],
        [-3.5000, 0.0016, 1.1477, 0.1062],
        [0.4659, -0.3296, -0.0876, -0.0329],
    ],
    [
        [-0.6000, -0.3566, -2.5000, 2.3250],
        [0.2937, 0.0496, -5.6812, 1.8415],
        [21.0000, -4.7656, -21.5906, 7.2492],
        [-3.5000, -0.1554, 1.4062, 0.3988],
        [0.0032, 0.0766, -0.0656, -0.1294],
    ],
    [
        [-1.0156, -0.3670, 1.0078, 1.4051],
        [0.2875, -0.5328, -3.8500, 3.3750],
        [14.0000, -0.9999, -7.1406, 7.5469],
        [-3.4000, -0.1078, -1.0750, 1.5702],
        [-0.0672, 0.4016, 0.3017, -0.4844],
    ],
    [
        [-1.0000, 0.0211, 0.5025, -0.5119],
        [-0.3000, 0.1922, 0.7023, -1.6317],
        [19.0000, -5.0000, 1.2438, -1.9094],
        [-4.0000, 0.0250, 0.3844, 0.2656],
        [1.0468, -0.3788, -2.4517, 1.4656],
    ],
    [
        [-1.0500, 0.0289, 0.4260, 0.3590],
        [-0.3250, 0.1156, 0.7781, 0.0025],
        [31.0625, -14.5000, -46.1148, 55.3750],
        [-7.2312, 0.4050, 13.3500, 0.6234],
        [1.5000, -0.6426, 1.8564, 0.5636],
    ],
];

/// Irradiance above the atmosphere at normal incidence, W/m2.
pub(super) const SOLAR_CONSTANT: f64 = 1361.0;

/// Relative path of sunlight through the air, with the sun at an angle from the zenith (Kasten and Young 1989).
pub(super) fn air_mass(zenith: f64) -> f64 {
    let degrees = zenith.to_degrees().min(90.0);
    1.0 / (libm::cos(degrees.to_radians()) + 0.50572 * libm::pow(96.07995 - degrees, -1.6364))
}

/// The all-weather sky of a direct normal and a diffuse horizontal irradiance (W/m2), with the sun at an angle from the
/// zenith, radians.
pub(super) fn all_weather(direct: f64, diffuse: f64, sun: f64) -> Distribution {
    let kappa = 1.041 * sun * sun * sun;
    let diffuse = diffuse.max(f64::MIN_POSITIVE);
    let clearness = ((diffuse + direct) / diffuse + kappa) / (1.0 + kappa);
    // Perez et al. bound the brightness where the tables of skies end.
    let brightness = (diffuse * air_mass(sun) / SOLAR_CONSTANT).clamp(0.01, 0.6);
    let row = CLEARNESSES.iter().filter(|&&bound| clearness >= bound).count();
    let table = &ALL_WEATHER[row];
    let mut parameters = table.map(|[p, q, r, s]| p + q * sun + brightness * (r + s * sun));
    if row == 0 {
        let [[c1, c2, c3, c4], [d1, d2, d3, d4]] = [table[2], table[3]];
        parameters[2] = libm::exp(libm::pow(brightness * (c1 + c2 * sun), c3)) - c4;
        parameters[3] = -libm::exp(brightness * (d1 + d2 * sun)) + d3 + brightness * d4;
    }
    Distribution { parameters }
}
