//! Real roots of low-order polynomials within an interval, in f64, always in finite time.

use smallvec::SmallVec;
use std::cmp::Ordering;

/// Halvings at most in the search for one root: 64 take any interval of f64 to its last bit.
const STEPS: usize = 64;

/// Value of the polynomial Σ cᵢ xⁱ.
fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Real roots of Σ cᵢ xⁱ (order at most 4) in `low`…`high`, ascending. Between neighbouring roots of its derivative a
/// polynomial is monotone, so every root where it changes sign is bracketed; one where it only touches zero may be
/// missed.
pub(super) fn roots_between(coefficients: &[f64], low: f64, high: f64) -> SmallVec<[f64; 8]> {
    debug_assert!(coefficients.len() <= 5, "order at most 4");
    let mut roots = SmallVec::new();
    if coefficients.len() < 2 || low.partial_cmp(&high) != Some(Ordering::Less) {
        return roots;
    }
    let derivative: SmallVec<[f64; 4]> = (1..coefficients.len()).map(|i| i as f64 * coefficients[i]).collect();
    let mut ends = roots_between(&derivative, low, high);
    ends.push(high);
    let (mut a, mut at_a) = (low, value(coefficients, low));
    for b in ends {
        let at_b = value(coefficients, b);
        if at_a == 0.0 {
            roots.push(a);
        } else if at_a * at_b < 0.0 {
            roots.push(bracketed(coefficients, &derivative, a, b, at_a < 0.0));
        }
        (a, at_a) = (b, at_b);
    }
    if at_a == 0.0 {
        roots.push(a);
    }
    roots
}

/// The root between `a` and `b`, where the sign changes: Newton's steps, halving where one leads out.
fn bracketed(coefficients: &[f64], derivative: &[f64], mut a: f64, mut b: f64, rising: bool) -> f64 {
    let mut x = 0.5 * (a + b);
    for _ in 0..STEPS {
        let y = value(coefficients, x);
        if y == 0.0 {
            return x;
        }
        if (y < 0.0) == rising {
            a = x;
        } else {
            b = x;
        }
        let newton = x - y / value(derivative, x);
        let next = if newton > a && newton < b { newton } else { 0.5 * (a + b) };
        if (next - x).abs() <= f64::EPSILON * (1.0 + x.abs()) {
            return next;
        }
        x = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::roots_between;

    #[test]
    fn roots_of_products_are_found() {
        for roots in [[-0.5, 0.1, 0.2, 0.9], [-1.0, -0.999, 0.0, 1.0], [0.3, 0.300_1, 0.7, 5.0]] {
            let mut coefficients = vec![1.0];
            for r in roots {
                let mut next = vec![0.0; coefficients.len() + 1];
                for (i, c) in coefficients.iter().enumerate() {
                    next[i] -= r * c;
                    next[i + 1] += c;
                }
                coefficients = next;
            }
            let found = roots_between(&coefficients, -2.0, 2.0);
            let inside: Vec<f64> = roots.into_iter().filter(|r| r.abs() < 2.0).collect();
            assert_eq!(found.len(), inside.len(), "all roots inside: {found:?}");
            for (f, r) in found.iter().zip(inside) {
                // Coefficients are rounded to 1e-16; the closest pair is 1e-4 apart, so a root moves by 1e-12.
                assert!((f - r).abs() < 1e-11, "root {r} found as {f}");
            }
        }
        assert!(roots_between(&[1.0, 0.0, 1.0], -5.0, 5.0).is_empty(), "x² + 1 has no root");
        assert!(roots_between(&[f64::NAN, 1.0], -1.0, 1.0).is_empty(), "NaN has no root");
    }
}
