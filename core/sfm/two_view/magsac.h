#pragma once

#include <array>

namespace pepeseg {

// Loss and weight of a residual whose noise level is only known to be below a limit: MAGSAC++
// (Barath, Noskova, Ivashechkin and Matas 2020). The noise is marginalised over [0, sigma_max]
// with residuals that are chi-distributed with four degrees of freedom (equations 4 to 7). The
// limit is the 0.99 quantile at the largest noise: 3.64 sigma_max.
class MagsacLoss {
 public:
  // `limit` > 0, in the unit of the residuals: where the loss ends.
  explicit MagsacLoss(double limit);

  double limit() const { return limit_; }

  // Returns the loss in [0, 1] of a squared residual: 0 at 0, 1 at and beyond the limit, and
  // for NaN.
  double Loss(double residual_squared) const { return Look(loss_, residual_squared, 1); }
  // Returns the weight in [0, 1] of a squared residual for iteratively reweighted least squares:
  // 1 at 0, 0 at and beyond the limit.
  double Weight(double residual_squared) const { return Look(weight_, residual_squared, 0); }

 private:
  // Both functions are smooth in the squared residual, so a table of 1024 steps is exact to 1e-3.
  static constexpr int kSteps = 1024;
  using Table = std::array<float, kSteps>;

  double Look(const Table& table, double residual_squared, double beyond) const {
    const double step = residual_squared * steps_per_unit_;
    return step < kSteps ? table[static_cast<int>(step)] : beyond;
  }

  double limit_;
  double steps_per_unit_;
  Table loss_, weight_;
};

}  // namespace pepeseg
