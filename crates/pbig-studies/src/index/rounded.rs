//! Newton's steps in every order and rounding that a machine may have: what of Avril's table 3 is the machine's, not the
//! method's.

/// The rounding of the result of one operation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rounding {
    /// To the nearest f32.
    Nearest,
    /// To the next f32 towards zero, as devices of 2008 cut the product of a multiply-add.
    TowardsZero,
    /// Not at all: it stays in a wider register.
    Wide,
}

impl Rounding {
    const ALL: [Self; 3] = [Self::Nearest, Self::TowardsZero, Self::Wide];

    fn of(self, x: f64) -> f64 {
        let nearest = x as f32;
        match self {
            Self::Wide => x,
            Self::TowardsZero if f64::from(nearest).abs() > x.abs() => {
                f64::from(f32::from_bits(nearest.to_bits() - 1))
            }
            _ => nearest.into(),
        }
    }
}

/// The computation of one step `y (1.5 - h y y)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// `h (y y)`, else `(h y) y`.
    square_first: bool,
    /// Roundings of both products, of the difference, and of the new `y`.
    roundings: [Rounding; 4],
}

impl Step {
    /// Every order and rounding.
    pub fn all() -> Vec<Self> {
        let rounding = |code: usize, place: u32| Rounding::ALL[code / 3usize.pow(place) % 3];
        let one = |code: usize| Self {
            square_first: code.is_multiple_of(2),
            roundings: std::array::from_fn(|place| rounding(code / 2, place as u32)),
        };
        (0..2 * 81).map(one).collect()
    }

    fn next(&self, half: f64, y: f64) -> f64 {
        let [first, second, difference, product] = self.roundings;
        let scaled = if self.square_first { half * first.of(y * y) } else { first.of(half * y) * y };
        product.of(y * difference.of(1.5 - second.of(scaled)))
    }
}

/// The use of the `y` that the steps give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// `x y` without its fraction.
    Cut,
    /// `x y` or the next whole number above.
    Up,
    /// `1 / y` without its fraction.
    Reciprocal,
}

impl Form {
    /// Each of them.
    pub const ALL: [Self; 3] = [Self::Cut, Self::Up, Self::Reciprocal];

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cut => "x y cut",
            Self::Up => "x y rounded up",
            Self::Reciprocal => "1 / y cut",
        }
    }

    /// Returns the result of an exact root.
    fn exact(self, x: u32) -> u32 {
        let root = x.isqrt();
        root + u32::from(self == Self::Up && root * root < x)
    }
}

/// A root by Newton's steps: the first two in one way, those after them in another, and what is made of their result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounded {
    early: Step,
    late: Step,
    form: Form,
    /// Rounding of the last product, or of the reciprocal.
    last: Rounding,
}

impl Rounded {
    /// With each rounding of the last operation.
    pub fn all(early: Step, late: Step, form: Form) -> impl Iterator<Item = Self> {
        Rounding::ALL.into_iter().map(move |last| Self { early, late, form, last })
    }

    fn root(&self, magic: u32, steps: u32, x: f32) -> u32 {
        let half = f64::from(x * 0.5);
        let mut y = f64::from(f32::from_bits(magic - (x.to_bits() >> 1)));
        for step in 0..steps {
            y = if step < 2 { self.early.next(half, y) } else { self.late.next(half, y) };
        }
        match self.form {
            Form::Cut => self.last.of(f64::from(x) * y) as u32,
            Form::Up => self.last.of(f64::from(x) * y).ceil() as u32,
            Form::Reciprocal => self.last.of(1.0 / y) as u32,
        }
    }

    /// As [`super::root_errors`], up to 2^24: for how many whole numbers `1 <= x < below` the whole number that is made of the
    /// root is wrong after two steps or more. These are off by less than one in 200,000, so that only numbers near a square
    /// can be.
    pub fn errors(&self, magic: u32, steps: u32, below: u32) -> u64 {
        let near = |root: u32| {
            let (square, reach) = (root * root, 2 + root * root / 100_000);
            square - reach.min(root - 1)..=square + reach.min(root)
        };
        let wrong = |x: &u32| self.root(magic, steps, *x as f32) != self.form.exact(*x);
        let all = (1..=below.isqrt() + 1).flat_map(near).filter(|x| (1..below).contains(x));
        all.filter(wrong).count() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CARMACK, LOMONT, Newton, WideNewton, root_errors};
    use super::*;

    fn with(rounding: [Rounding; 4]) -> Rounded {
        let step = Step { square_first: false, roundings: rounding };
        Rounded { early: step, late: step, form: Form::Cut, last: Rounding::Nearest }
    }

    /// All in f32, and each step in f64, are two of them, which are counted over all numbers elsewhere.
    #[test]
    fn errors_near_squares_are_all() {
        use Rounding::{Nearest, Wide};
        for below in [4, 1000, 99_856, 1_000_000] {
            let narrow = with([Nearest; 4]);
            assert_eq!(narrow.errors(CARMACK, 2, below), root_errors::<Newton<CARMACK, 2>>(below));
            assert_eq!(narrow.errors(LOMONT, 4, below), root_errors::<Newton<LOMONT, 4>>(below));
            let wide = with([Wide, Wide, Wide, Nearest]);
            assert_eq!(wide.errors(LOMONT, 2, below), root_errors::<WideNewton<LOMONT, 2>>(below));
            assert_eq!(wide.errors(CARMACK, 3, below), root_errors::<WideNewton<CARMACK, 3>>(below));
        }
    }
}
