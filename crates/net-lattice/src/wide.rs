//! Plain loops over arrays, compiled for the widest instructions that the processor has: the same operations in the same order, so the same results everywhere.

/// Defines a function whose body, and all that is always inlined into it, is compiled for every width of instructions; the widest that the processor has is run.
macro_rules! widely {
    ($(#[$doc:meta])* $visible:vis fn $name:ident<'a>($($arg:ident: $type:ty),* $(,)?) -> $output:ty $body:block) => {
        $(#[$doc])*
        $visible fn $name<'a>($($arg: $type),*) -> $output {
            struct Call<'a> {
                $($arg: $type),*
            }
            impl<'a> pulp::WithSimd for Call<'a> {
                type Output = $output;

                #[inline(always)]
                fn with_simd<S: pulp::Simd>(self, _: S) -> $output {
                    let Self { $($arg),* } = self;
                    $body
                }
            }
            pulp::Arch::new().dispatch(Call { $($arg),* })
        }
    };
}

pub(crate) use widely;
