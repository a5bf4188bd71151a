//! Plan of a one-dimensional transform: the library's own where it is fast, otherwise what suits the length.

use std::f64::consts::TAU;
use std::sync::Arc;

use rustfft::algorithm::BluesteinsAlgorithm;
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

/// Largest prime factor for which the library has fast kernels.
const LARGEST_FAST_PRIME: usize = 11;
/// Largest prime factor that is multiplied out: its cost grows with it, a convolution's does not. Near 100 they meet.
const LARGEST_DIRECT_PRIME: usize = 97;
/// Transforms by the definition that are done side by side.
const LANES: usize = 8;
/// Their real and imaginary parts.
type Numbers = [f32; 2 * LANES];

/// What transforms of one length write to on their way.
#[derive(Clone, Default)]
pub(crate) struct LineScratch {
    numbers: Vec<Complex32>,
    /// Of a prime factor's rows j and -j, side by side: their sum, and their difference times -i.
    pairs: Vec<[Numbers; 2]>,
}

impl LineScratch {
    /// Scratch for each of `plans`.
    pub fn of(plans: &[&LineFft]) -> Self {
        let longest = |length: fn(&LineFft) -> usize| plans.iter().map(|plan| length(plan)).max().unwrap_or(0);
        Self {
            numbers: vec![Complex32::default(); longest(LineFft::scratch_len)],
            pairs: vec![Default::default(); longest(LineFft::half_prime)],
        }
    }
}

/// Transforms in place of lines of one length, in natural order.
#[derive(Clone)]
pub(crate) enum LineFft {
    Library(Arc<dyn Fft<f32>>),
    Prime(PrimeFft),
}

impl LineFft {
    /// The plan for `length` points, by its factors alone.
    ///
    /// A prime factor without a fast kernel makes the library's own plan several times as slow. One of moderate size (848 has 53) is multiplied out, for many
    /// lines side by side; where that cannot be, the whole line becomes a convolution (Bluestein 1970) of twice the length, which can have any factors.
    pub fn new(length: usize) -> Self {
        let mut planner = FftPlanner::new();
        let prime = without_factors_up_to(LARGEST_FAST_PRIME, length);
        if prime <= 1 {
            return Self::Library(planner.plan_fft_forward(length));
        }
        // Below the square of the smallest prime left, whatever is left is prime.
        if prime <= LARGEST_DIRECT_PRIME && (length / prime).is_multiple_of(LANES) {
            return Self::Prime(PrimeFft::new(prime, planner.plan_fft_forward(length / prime)));
        }
        let inner = (2 * length - 1..).find(|&n| without_factors_up_to(3, n) == 1).unwrap_or(length);
        Self::Library(Arc::new(BluesteinsAlgorithm::new(length, planner.plan_fft_forward(inner))))
    }

    fn scratch_len(&self) -> usize {
        match self {
            Self::Library(plan) => plan.get_inplace_scratch_len(),
            Self::Prime(plan) => plan.scratch_len(),
        }
    }

    fn half_prime(&self) -> usize {
        match self {
            Self::Library(_) => 0,
            Self::Prime(plan) => plan.prime / 2,
        }
    }

    /// Transforms one line.
    pub fn process(&self, line: &mut [Complex32], scratch: &mut LineScratch) {
        match self {
            Self::Library(plan) => plan.process_with_scratch(line, &mut scratch.numbers),
            Self::Prime(plan) => plan.process(line, scratch),
        }
    }
}

/// What is left of `number`, above 0, divided by all its factors up to `largest`.
fn without_factors_up_to(largest: usize, mut number: usize) -> usize {
    for factor in 2..=largest {
        while number.is_multiple_of(factor) {
            number /= factor;
        }
    }
    number
}

/// Mixed radix of two factors (Cooley & Tukey 1965): the odd prime by the definition, of which symmetry leaves a quarter of the products, the rest by the library.
#[derive(Clone)]
pub(crate) struct PrimeFft {
    arch: pulp::Arch,
    prime: usize,
    rest: Arc<dyn Fft<f32>>,
    /// Cosine and sine of one turn's j k-th part of `prime`, for k and then j from 1 to half of it.
    waves: Vec<[f32; 2]>,
    /// exp(-2 pi i k n / length), for k below `prime` and then n below the rest's length.
    twiddles: Vec<Complex32>,
}

impl PrimeFft {
    fn new(prime: usize, rest: Arc<dyn Fft<f32>>) -> Self {
        let angle = |part: usize, of: usize| TAU * (part % of) as f64 / of as f64;
        let half = prime / 2;
        let waves = (1..=half).flat_map(|k| (1..=half).map(move |j| j * k));
        let length = prime * rest.len();
        let twiddles = (0..prime).flat_map(|k| (0..rest.len()).map(move |n| k * n));
        Self {
            arch: pulp::Arch::new(),
            prime,
            waves: waves.map(|jk| angle(jk, prime)).map(|a| [a.cos() as f32, a.sin() as f32]).collect(),
            twiddles: twiddles
                .map(|kn| angle(kn, length))
                .map(|a| Complex32::new(a.cos() as f32, -a.sin() as f32))
                .collect(),
            rest,
        }
    }

    fn scratch_len(&self) -> usize {
        self.twiddles.len() + self.rest.get_inplace_scratch_len()
    }

    /// The line is a table of as many rows as the prime says.
    fn process(&self, line: &mut [Complex32], scratch: &mut LineScratch) {
        let (turned, rest) = scratch.numbers.split_at_mut(self.twiddles.len());
        let pairs = &mut scratch.pairs[..self.prime / 2];
        self.arch.dispatch(Columns { plan: self, table: line, pairs, out: turned });
        for (to, twiddle) in turned.iter_mut().zip(&self.twiddles) {
            *to *= twiddle;
        }
        self.rest.process_with_scratch(turned, rest);
        transpose::transpose(turned, line, self.rest.len(), self.prime);
    }

    /// Transforms columns `first` and on, as many as there are lanes.
    #[inline(always)]
    fn transform_columns(&self, table: &[Complex32], first: usize, pairs: &mut [[Numbers; 2]], out: &mut [Complex32]) {
        let width = self.rest.len();
        let half = self.prime / 2;
        let row = |v: usize| numbers(&table[v * width + first..]);
        let constant = row(0);
        let mut total = constant;
        for (j, [sum, difference]) in pairs.iter_mut().enumerate() {
            let (a, b) = (row(j + 1), row(self.prime - j - 1));
            for i in 0..2 * LANES {
                sum[i] = a[i] + b[i];
                total[i] += sum[i];
            }
            for i in (0..2 * LANES).step_by(2) {
                difference[i] = a[i + 1] - b[i + 1];
                difference[i + 1] = b[i] - a[i];
            }
        }
        let mut write = |v: usize, values: &Numbers| {
            let to = &mut out[v * width + first..][..LANES];
            for (to, value) in to.iter_mut().zip(values.chunks_exact(2)) {
                *to = Complex32::new(value[0], value[1]);
            }
        };
        write(0, &total);
        for (k, waves) in self.waves.chunks_exact(half).enumerate() {
            // exp(-i x) = cos x - i sin x.
            let (mut even, mut odd) = (constant, Numbers::default());
            for (&[cosine, sine], [sum, difference]) in waves.iter().zip(&*pairs) {
                for i in 0..2 * LANES {
                    even[i] += cosine * sum[i];
                    odd[i] += sine * difference[i];
                }
            }
            let (mut before, mut after) = (even, even);
            for i in 0..2 * LANES {
                before[i] += odd[i];
                after[i] -= odd[i];
            }
            write(k + 1, &before);
            write(self.prime - k - 1, &after);
        }
    }
}

/// The columns' transforms as a task for the widest vectors that the processor has.
struct Columns<'a> {
    plan: &'a PrimeFft,
    table: &'a [Complex32],
    pairs: &'a mut [[Numbers; 2]],
    out: &'a mut [Complex32],
}

impl pulp::WithSimd for Columns<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        for first in (0..self.plan.rest.len()).step_by(LANES) {
            self.plan.transform_columns(self.table, first, self.pairs, self.out);
        }
    }
}

/// Real and imaginary parts of the first values.
#[inline(always)]
fn numbers(values: &[Complex32]) -> Numbers {
    let mut numbers = Numbers::default();
    for (to, value) in numbers.chunks_exact_mut(2).zip(values) {
        (to[0], to[1]) = (value.re, value.im);
    }
    numbers
}
