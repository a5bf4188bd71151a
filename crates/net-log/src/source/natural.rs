//! Natural order of file names: `frame2` before `frame10`.

use std::cmp::Ordering;

/// Compares runs of digits by their value and everything else byte by byte. Names that differ only in leading zeros fall back
/// to plain order, so that the order is total.
pub(crate) fn compare(a: &str, b: &str) -> Ordering {
    let (mut x, mut y) = (a.as_bytes(), b.as_bytes());
    while let (Some(&p), Some(&q)) = (x.first(), y.first()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n) = (digits(&mut x), digits(&mut y));
            // Without leading zeros the longer number is the larger one.
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
        } else {
            (x, y) = (&x[1..], &y[1..]);
            p.cmp(&q)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

/// Takes the digits off the front, without leading zeros.
fn digits<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|b| !b.is_ascii_digit()).unwrap_or(text.len());
    let (run, rest) = text.split_at(end);
    *text = rest;
    let start = run.iter().position(|&b| b != b'0').unwrap_or(run.len());
    &run[start..]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_count_by_value() {
        let mut names = ["f10.png", "f2.png", "f1.png", "f02.png", "e99.png", "f2b.png", "f2.jpg", ""];
        names.sort_by(|a, b| compare(a, b));
        assert_eq!(names, ["", "e99.png", "f1.png", "f2.jpg", "f02.png", "f2.png", "f2b.png", "f10.png"]);
    }

    #[test]
    fn numbers_beyond_any_integer_type() {
        let huge = "1".repeat(40);
        assert_eq!(compare(&huge, &format!("{huge}0")), Ordering::Less);
    }

    proptest! {
        #[test]
        fn it_is_a_total_order(a in "[a0-2]{0,5}", b in "[a0-2]{0,5}", c in "[a0-2]{0,5}") {
            prop_assert_eq!(compare(&a, &b), compare(&b, &a).reverse());
            prop_assert_eq!(compare(&a, &b) == Ordering::Equal, a == b);
            if compare(&a, &b) != Ordering::Greater && compare(&b, &c) != Ordering::Greater {
                prop_assert_ne!(compare(&a, &c), Ordering::Greater);
            }
        }
    }
}
