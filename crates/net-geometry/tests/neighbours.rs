//! Neighbours and clusters against brute force and against kiddo's k-d tree.
#![allow(clippy::unwrap_used)]

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use net_geometry::nalgebra::Vector2;
use net_geometry::{Dbscan, NearestPoints};
use proptest::prelude::*;

fn points(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Vector2<f64>>> {
    // Half of them on a coarse grid, so that many distances are equal, some points are one, and some lie on a line.
    let coordinate = prop_oneof![-50.0..50.0, (-5i32..5).prop_map(f64::from)];
    prop::collection::vec((coordinate.clone(), coordinate).prop_map(|(x, y)| Vector2::new(x, y)), count)
}

/// DBSCAN as it is defined, O(n²).
fn naive_clusters(points: &[Vector2<f64>], radius: impl Fn(usize) -> f64, min_points: usize) -> Vec<Option<u32>> {
    let near = |i: usize| {
        let r = radius(i);
        (0..points.len()).filter(move |&j| r >= 0.0 && (points[i] - points[j]).norm_squared() <= r * r)
    };
    let mut labels = vec![None; points.len()];
    let mut clusters = 0;
    for seed in 0..points.len() {
        if labels[seed].is_some() || near(seed).count() < min_points {
            continue;
        }
        let mut stack = vec![seed];
        while let Some(i) = stack.pop() {
            labels[i] = Some(clusters);
            if near(i).count() >= min_points {
                stack.extend(near(i).filter(|&j| labels[j].is_none()));
            }
        }
        clusters += 1;
    }
    labels
}

proptest! {
    #[test]
    fn within_is_brute_force(points in points(0..80), x in -60.0..60.0, y in -60.0..60.0, radius in 0.0..40.0) {
        let centre = Vector2::new(x, y);
        let mut grid = NearestPoints::default();
        grid.fill(&points);
        let mut found: Vec<_> = grid.within(centre, radius).collect();
        found.sort_unstable();
        let expected: Vec<_> = (0..points.len()).filter(|&i| (points[i] - centre).norm_squared() <= radius * radius).collect();
        prop_assert_eq!(&found, &expected);
        // A point is its own neighbour at any radius from zero.
        for (i, &p) in points.iter().enumerate() {
            prop_assert!(grid.within(p, 0.0).any(|j| j == i));
        }
    }

    #[test]
    fn nearest_is_kiddos(points in points(1..80), x in -60.0..60.0, y in -60.0..60.0, radius in 0.0..60.0) {
        let mut grid = NearestPoints::default();
        grid.fill(&points);
        let raw: Vec<[f64; 2]> = points.iter().map(|p| [p.x, p.y]).collect();
        let tree = ImmutableKdTree::<f64, 2>::new_from_slice(&raw).unwrap();
        let nearest = tree.query(&[x, y]).nearest_one::<SquaredEuclidean<f64>>().execute();
        match grid.nearest(Vector2::new(x, y), radius) {
            Some((index, distance)) => {
                prop_assert!((distance - nearest.distance.sqrt()).abs() < 1e-12);
                prop_assert!(((points[index] - Vector2::new(x, y)).norm() - distance).abs() < 1e-12);
            }
            None => prop_assert!(nearest.distance > radius * radius),
        }
        let mut within = tree.query(&[x, y]).within::<SquaredEuclidean<f64>>(radius * radius).execute().into_iter()
            .map(|r| r.item as usize).collect::<Vec<_>>();
        within.sort_unstable();
        let mut ours: Vec<_> = grid.within(Vector2::new(x, y), radius).collect();
        ours.sort_unstable();
        prop_assert_eq!(ours, within);
    }

    #[test]
    fn clusters_are_the_definitions(points in points(0..60), radius in 0.0..10.0, spread in 0.0..1.0, min_points in 1usize..5) {
        // Each point has its own radius.
        let radius = |i: usize| radius * (1.0 + spread * ((i * 7 % 5) as f64 / 5.0));
        let (mut dbscan, mut labels) = (Dbscan::default(), Vec::new());
        // A run before leaves nothing behind.
        dbscan.cluster(&[Vector2::new(1.0, 2.0); 9], |_| 1.0, 2, &mut labels);
        let clusters = dbscan.cluster(&points, radius, min_points, &mut labels);
        prop_assert_eq!(&labels, &naive_clusters(&points, radius, min_points));
        prop_assert_eq!(clusters, labels.iter().flatten().max().map_or(0, |&c| c + 1));
    }
}

#[test]
fn three_corners_of_a_cell_and_a_stray() {
    let points =
        [(0.0, 0.0), (100.0, 0.0), (2.0, 1.0), (101.0, 1.0), (1.0, 2.0), (50.0, 50.0)].map(|(x, y)| Vector2::new(x, y));
    let (mut dbscan, mut labels) = (Dbscan::default(), Vec::new());
    assert_eq!(dbscan.cluster(&points, |_| 3.0, 2, &mut labels), 2);
    assert_eq!(labels, [Some(0), Some(1), Some(0), Some(1), Some(0), None]);
}

#[test]
fn bad_points_and_radii_are_nobodys_neighbours() {
    let mut points = vec![Vector2::new(1.0, 1.0), Vector2::new(1.0, 2.0), Vector2::new(2.0, 1.0)];
    points.push(Vector2::new(f64::NAN, 1.0));
    points.push(Vector2::new(1.0, f64::INFINITY));
    let (mut dbscan, mut labels) = (Dbscan::default(), Vec::new());
    assert_eq!(dbscan.cluster(&points, |_| 1.5, 2, &mut labels), 1);
    assert_eq!(labels, [Some(0), Some(0), Some(0), None, None]);
    for radius in [f64::NAN, -1.0] {
        assert_eq!(dbscan.cluster(&points, |_| radius, 1, &mut labels), 0);
    }
    assert_eq!(dbscan.cluster(&points, |_| f64::INFINITY, 3, &mut labels), 1);
    assert_eq!(labels, [Some(0), Some(0), Some(0), None, None]);
    assert_eq!(dbscan.cluster(&[], |_| 1.0, 1, &mut labels), 0);

    let mut grid = NearestPoints::default();
    assert_eq!(grid.nearest(Vector2::zeros(), 1e9), None);
    grid.fill(&points[3..]);
    assert_eq!(grid.nearest(Vector2::zeros(), 1e9), None);
    grid.fill(&points);
    assert_eq!(grid.nearest(Vector2::new(f64::NAN, 0.0), 1e9), None);
    assert_eq!(grid.nearest(Vector2::new(1.0, 1.9), f64::NAN), None);
    assert_eq!(grid.nearest(Vector2::new(1.0, 1.9), 1e9).unwrap().0, 1);
    // Points worlds apart, in one cell or in many.
    grid.fill(&[Vector2::new(-1e300, 0.0), Vector2::new(1e300, 1e300), Vector2::new(0.0, 1e-300)]);
    assert_eq!(grid.nearest(Vector2::new(0.0, 0.0), 1.0), Some((2, 1e-300f64.powi(2).sqrt())));
    assert_eq!(grid.within(Vector2::zeros(), f64::INFINITY).count(), 3);
    // Equally near: the first.
    grid.fill(&[Vector2::new(1.0, 0.0), Vector2::new(-1.0, 0.0), Vector2::new(1.0, 0.0)]);
    assert_eq!(grid.nearest(Vector2::zeros(), 1.0), Some((0, 1.0)));
}
