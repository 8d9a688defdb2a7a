use super::*;

/// An image of patternless texels.
fn image(size: [usize; 2]) -> Pyramid {
    let mut state = 7u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let rgba = (0..size[0] * size[1]).flat_map(|_| [next(), next(), next(), 255]).collect();
    Pyramid::new(size, rgba, 0).unwrap()
}

fn cover(pyramid: &Pyramid, wrap: Wrap) -> Cover<'_> {
    Cover { pyramid, wrap: [wrap; 2], resolution: 4096.0 }
}

/// The mean over a triangle, from very many points.
fn brute(cover: &Cover<'_>, triangle: [DVec2; 3]) -> Sums {
    let n = 1500;
    let corners = triangle.map(|p| cover.texels(p));
    let mut sums = [0.0; 5];
    for_each_third(n, |w| {
        let value = cover.nearest(corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]);
        (0..5).for_each(|c| sums[c] += value[c]);
    });
    sums.map(|s| s / (n * n) as f64)
}

const SKEW: [DVec2; 3] = [DVec2::new(0.13, 0.21), DVec2::new(0.87, 0.3), DVec2::new(0.4, 0.93)];

#[test]
fn means_over_triangles_are_those_of_many_points() {
    for size in [[1, 1], [2, 2], [7, 5], [33, 64]] {
        let pyramid = image(size);
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge] {
            let cover = cover(&pyramid, wrap);
            for (scale, shift) in [(1.0, 0.0), (0.02, 0.4), (3.7, -1.3)] {
                let triangle = SKEW.map(|p| p * scale + DVec2::splat(shift));
                let (mean, right) = (cover.mean(triangle), brute(&cover, triangle));
                for c in 0..5 {
                    let off = (mean[c] - right[c]).abs();
                    assert!(off < 2e-3, "{size:?} {wrap:?} x {scale}: {mean:?}, not {right:?}");
                }
            }
        }
    }
}

#[test]
fn the_parts_of_an_image_sum_to_the_whole_however_often_it_repeats() {
    let pyramid = image([48, 20]);
    for wrap in [Wrap::Repeat, Wrap::MirroredRepeat] {
        for periods in [1.0, 6.0, 1000.0] {
            let cover = Cover { resolution: 64.0, ..cover(&pyramid, wrap) };
            let corner = |x: f64, y: f64| DVec2::new(x, y) * periods;
            let inner = DVec2::new(0.37, 0.61) * periods;
            let outer = [corner(0., 0.), corner(1., 0.), corner(1., 1.), corner(0., 1.)];
            let mut all = (0.0, [0.0; 5]);
            for k in 0..4 {
                let (area, sums) = cover.integral(&[outer[k], outer[(k + 1) % 4], inner]);
                all.0 += area;
                (0..5).for_each(|c| all.1[c] += sums[c]);
            }
            let mean = pyramid.mean();
            for c in 0..5 {
                let off = (all.1[c] / all.0 / mean[c] - 1.0).abs();
                assert!(off < 1e-3, "{wrap:?} {periods} {c}: {off}");
            }
        }
    }
}

#[test]
fn points_and_lines_of_texture_coordinates_are_looked_up() {
    let pyramid = Pyramid::new([2, 1], vec![255, 0, 0, 255, 0, 255, 0, 255], 0).unwrap();
    let cover = cover(&pyramid, Wrap::Repeat);
    assert_eq!(cover.mean([DVec2::new(0.25, 0.5); 3])[..2], [1.0, 0.0]);
    assert_eq!(cover.mean([DVec2::new(1.75, -0.5); 3])[..2], [0.0, 1.0]);
    // Half the area of a triangle lies within 1 / sqrt 2 of one corner's distance.
    let line = [0.0, 1.0, 1.0].map(|x| DVec2::new(16.0 * x, 0.5));
    assert!((cover.mean(line)[0] - 0.5).abs() < 0.02, "{:?}", cover.mean(line));
}

#[test]
fn what_is_no_number_or_endless_counts_as_the_mean() {
    let pyramid = image([8, 8]);
    for wrap in [Wrap::Repeat, Wrap::ClampToEdge] {
        let cover = cover(&pyramid, wrap);
        for far in [f64::NAN, f64::INFINITY, 1e300, 1e20] {
            let mean = cover.mean([DVec2::ZERO, DVec2::new(far, 0.0), DVec2::new(0.0, far)]);
            assert!(mean.iter().all(|m| (0.0..=1.0).contains(m)), "{far}: {mean:?}");
        }
    }
}
