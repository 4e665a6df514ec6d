//! A straight line through points.

/// value = middle + slope (place - centre).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    centre: f64,
    middle: f64,
    /// Change of the value per unit of the place; zero if there are not two places.
    pub(crate) slope: f64,
}

impl Line {
    /// The line of least squares through points (place, value).
    pub(crate) fn through(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let count = points.clone().count().max(1) as f64;
        let centre = points.clone().map(|point| point.0).sum::<f64>() / count;
        let middle = points.clone().map(|point| point.1).sum::<f64>() / count;
        let (mut spread, mut product) = (0.0, 0.0);
        for (place, value) in points {
            spread += (place - centre).powi(2);
            product += (place - centre) * (value - middle);
        }
        Self {
            centre,
            middle,
            slope: if spread > 0.0 { product / spread } else { 0.0 },
        }
    }

    pub(crate) fn at(&self, place: f64) -> f64 {
        self.middle + self.slope * (place - self.centre)
    }
}
