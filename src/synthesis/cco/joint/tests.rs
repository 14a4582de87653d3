//! The search for the best place against a dense one.

use super::*;
use crate::synthesis::random::Stream;
use rand::RngExt;

/// Volume of a tree whose root segment is the joint's trunk.
fn volume(joint: &Joint, place: DVec3) -> f64 {
    joint.sums(place).trunk.volume
}

/// The best place in the plane of the ends, by grids that become finer around the best point.
fn dense(joint: &Joint) -> DVec3 {
    let [a, b, c] = joint.ends;
    let (u, v) = (b - a, c - a);
    let (mut best, mut center, mut reach) = (f64::MAX, (0.33, 0.33), 1.0);
    for _ in 0..14 {
        let around = center;
        for i in -20..=20 {
            for j in -20..=20 {
                let at = (around.0 + reach * f64::from(i) / 20.0, around.1 + reach * f64::from(j) / 20.0);
                let value = volume(joint, a + u * at.0 + v * at.1);
                if value < best {
                    (best, center) = (value, at);
                }
            }
        }
        reach *= 0.35;
    }
    a + u * center.0 + v * center.1
}

#[test]
fn the_place_of_least_volume_is_that_of_a_dense_search() {
    let mut rng = Stream::Statistics.rng(11);
    let (mut at_ends, mut other_minima, mut worst) = (0, 0, 0.0f64);
    for case in 0..1000 {
        let mut point = || DVec3::new(rng.random(), rng.random(), rng.random());
        let ends = [point(), point(), point()];
        let exponent = Exponent::new([3.0, 2.55, 2.1][case % 3]);
        let flow = f64::from(rng.random_range(1..300u32));
        let load = flow * rng.random::<f64>() * 4.0;
        let below = Below { load, power: exponent.raise(load, load.sqrt()), span: rng.random::<f64>() * 20.0 };
        let joint = Joint { ends, flows: [flow, 1.0], below: [below, Below::default()], exponent };
        let start = joint.start();
        let found = joint.settle(start, &joint.sums(start), &Slope::ROOT, 1e-14);
        let best = dense(&joint);
        let excess = volume(&joint, found) / volume(&joint, best) - 1.0;
        // At an end, where a segment vanishes, there is nothing to be found: such candidates are too short.
        let longest = ends.iter().map(|end| end.distance(best)).fold(0.0, f64::max);
        let is_at_end = ends.iter().any(|end| end.distance(best) < AT_END * longest);
        at_ends += usize::from(is_at_end);
        worst = worst.max(excess);
        if is_at_end {
            assert!(excess < 1e-2, "case {case}: {excess:e}, {found} {best}");
        } else if excess > 1e-7 {
            // Another minimum, since the volume is not convex: nothing around it is better.
            let [a, b, c] = ends;
            for step in [b - a, a - b, c - a, a - c] {
                assert!(volume(&joint, found + step * 1e-3) > volume(&joint, found), "case {case}: {excess:e}");
            }
            assert!(excess < 1e-4, "case {case}: {excess:e}, {found} {best}");
            other_minima += 1;
        }
    }
    println!("worst excess {worst:e}, {at_ends} best places at ends, {other_minima} other minima");
    assert!(other_minima <= 5 && at_ends < 800);
}

#[test]
fn pulls_are_the_derivatives_by_the_lengths() {
    let exponent = Exponent::new(2.7);
    let below = Below { load: 3.0, power: exponent.raise(3.0, 3.0f64.sqrt()), span: 2.0 };
    let ends = [DVec3::ZERO, DVec3::new(1.0, 0.2, 0.0), DVec3::new(0.6, 1.0, 0.3)];
    let joint = Joint { ends, flows: [5.0, 1.0], below: [below, Below::default()], exponent };
    let mut slope = Slope::ROOT;
    (slope.load, slope.volume) = (0.3, 1.7);
    let place = joint.start();
    let cost = |place| {
        let trunk = joint.sums(place).trunk;
        slope.load * trunk.load + slope.volume * trunk.volume
    };
    let pulls = joint.pulls(&joint.sums(place), &slope);
    for axis in DVec3::AXES {
        let numeric = (cost(place + axis * 1e-6) - cost(place - axis * 1e-6)) / 2e-6;
        let exact: f64 = (0..3).map(|end| pulls[end] * (place - ends[end]).normalize().dot(axis)).sum();
        assert!((numeric - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{numeric} {exact}");
    }
}

#[test]
fn a_search_looks_at_a_bounded_number_of_places_whatever_the_numbers_are() {
    let mut rng = Stream::Statistics.rng(12);
    let (mut most, mut sum) = (0, 0);
    for case in 0..3000 {
        let mut any = |decades: f64| 10.0f64.powf(rng.random_range(-decades..decades));
        let exponent = Exponent::new([3.0, 2.0, 4.0][case % 3]);
        let (size, load) = (any(8.0), any(30.0));
        let below = Below { load, power: exponent.raise(load, load.sqrt()), span: any(20.0) };
        let flows = [any(15.0), any(15.0)];
        let mut slope = Slope::ROOT;
        (slope.load, slope.volume) = (any(20.0), any(20.0));
        // Long and thin triangles, too.
        let flat = if case % 2 == 0 { 1.0 } else { any(6.0) };
        let mut point = || size * DVec3::new(rng.random(), flat * rng.random::<f64>(), rng.random());
        let ends = [point(), point(), point()];
        let joint = Joint { ends, flows, below: [below, Below::default()], exponent };
        let start = joint.start();
        let (place, looks) = joint.descend(start, &joint.sums(start), &slope, [1e-12, 1e-4][case % 2]);
        assert!(place.is_finite(), "case {case}");
        (most, sum) = (most.max(looks), sum + looks);
    }
    assert!(most < MOST_LOOKS + 2 * HALVINGS, "{most} places");
    assert!(sum < 3000 * MOST_LOOKS / 4, "{sum} places in all");
}
