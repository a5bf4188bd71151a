//! Plain loops over arrays, compiled for the widest instructions that the processor has: the same operations in the same order, so the same results everywhere.

/// Defines a function whose body, and all that is always inlined into it, is compiled for every width of instructions; the widest that the processor has is run.
///
/// ```
/// net_image::widely! {
///     /// Adds one row to another.
///     fn add<'a>(sums: &'a mut [f32], row: &'a [f32]) -> () {
///         sums.iter_mut().zip(row).for_each(|(s, v)| *s += v);
///     }
/// }
/// let mut sums = [1.0, 2.0];
/// add(&mut sums, &[3.0, 4.0]);
/// assert_eq!(sums, [4.0, 6.0]);
/// ```
#[macro_export]
macro_rules! widely {
    ($(#[$doc:meta])* $visible:vis fn $name:ident<'a>($($arg:ident: $type:ty),* $(,)?) -> $output:ty $body:block) => {
        $(#[$doc])*
        $visible fn $name<'a>($($arg: $type),*) -> $output {
            struct Call<'a> {
                $($arg: $type),*
            }
            impl<'a> $crate::pulp::WithSimd for Call<'a> {
                type Output = $output;

                #[inline(always)]
                fn with_simd<S: $crate::pulp::Simd>(self, _: S) -> $output {
                    let Self { $($arg),* } = self;
                    $body
                }
            }
            $crate::pulp::Arch::new().dispatch(Call { $($arg),* })
        }
    };
}
