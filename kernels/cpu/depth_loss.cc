#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/depth.h"

// Depth loss in two passes over bands of scanlines: the first normalises the depth and sums the
// moments of the fit, the second compares. Moments of windows are box sums: those of the columns
// slide down the band, those of the window slide along each scanline. Each band starts its own
// columns, so that its result does not depend on which thread had the band above. All moments are
// double, because the sliding sums subtract what they added.

namespace pepeseg {
namespace {

constexpr int kBandRows = 32;  // scanlines of a task, and the granularity of the sums

// A task and its sums; `patch` is the rectangle of DepthLocalForm::kPatch.
struct Band {
  int first_row, end_row;
  DepthMoments<double> view = {}, patch = {};
  double view_error = 0, local_error = 0;  // sums of |residual|, not weighted
};

struct DepthJob {
  const DepthLossArgs* args;
  float* x;  // [H, W] Dhat; NaN where the pixel does not count
  DepthFit fit;
};

bool IsInside(const PixelBox& box, int x, int y) {
  return x >= box.x && x < box.x + box.width && y >= box.y && y < box.y + box.height;
}

// False also where there is no local term at all.
bool FitsWindows(const DepthLossArgs& args) {
  return args.local_form == DepthLocalForm::kWindows && args.local_weight > 0;
}

// Writes x and the moments of a band. Moments are summed for each scanline first.
void GatherBand(const DepthJob& job, Band& band) {
  const DepthLossArgs& args = *job.args;
  for (int y = band.first_row; y < band.end_row; ++y) {
    DepthMoments<double> row = {}, in_patch = {};
    for (int column = 0; column < args.width; ++column) {
      const int64_t i = int64_t{y} * args.width + column;
      const float prior = args.prior[i];
      const bool counts = args.alpha[i] > args.min_alpha && args.min_prior <= prior &&
                          prior <= args.max_prior && (args.ignore.empty() || args.ignore[i] == 0);
      job.x[i] = counts ? NormalizedDepth(args.depth[i], args.alpha[i])
                        : std::numeric_limits<float>::quiet_NaN();
      if (!counts) continue;
      const auto moments = DepthMomentsOf<double>(job.x[i], prior);
      row = row + moments;
      if (IsInside(args.patch, column, y)) in_patch = in_patch + moments;
    }
    // Per scanline first, so that small terms are not added to a large sum one by one.
    band.view = band.view + row;
    band.patch = band.patch + in_patch;
  }
}

// Moments of each column over the scanlines of the windows, as five planes of [width].
class ColumnMoments {
 public:
  explicit ColumnMoments(int width) : width_(width), planes_(size_t{5} * width) {}

  // Adds a scanline with sign 1, removes it with sign -1. Branch-free, so that it vectorises.
  void AddRow(const float* x, const float* d, double sign) {
    double* const count = planes_.data();
    double *const sum_x = count + width_, *const sum_d = sum_x + width_;
    double *const sum_xx = sum_d + width_, *const sum_xd = sum_xx + width_;
    for (int i = 0; i < width_; ++i) {
      const bool counts = x[i] == x[i];
      const double own = counts ? sign : 0, own_x = counts ? x[i] : 0, own_d = counts ? d[i] : 0;
      count[i] += own;
      sum_x[i] += own * own_x;
      sum_d[i] += own * own_d;
      sum_xx[i] += own * own_x * own_x;
      sum_xd[i] += own * own_x * own_d;
    }
  }
  DepthMoments<double> At(int i) const {
    const double* const at = planes_.data() + i;
    return {at[0], at[width_], at[2 * width_], at[3 * width_], at[4 * width_]};
  }

 private:
  int64_t width_;
  std::vector<double> planes_;
};

// Writes the gradients of one pixel that counts and adds its errors.
void ComparePixel(const DepthJob& job, int64_t i, const ScaleShift<float>& local, float local_grad,
                  Band& band) {
  const DepthLossArgs& args = *job.args;
  const auto compared = CompareDepth(job.fit, local, local_grad, job.x[i], args.prior[i]);
  const auto grad = NormalizedDepthVjp(job.x[i], args.alpha[i], compared.grad);
  args.depth_grad[i] = grad.depth_sum;
  args.alpha_grad[i] = grad.alpha;
  band.view_error += compared.view_error;
  band.local_error += compared.local_error;
}

// Slides the window along scanline y, of which `columns` holds the moments.
void CompareRowInWindows(const DepthJob& job, const ColumnMoments& columns, int y, Band& band) {
  const DepthLossArgs& args = *job.args;
  const int radius = args.window_radius;
  // The window of column 0 without its last column, which the loop adds.
  DepthMoments<double> window = {};
  for (int column = 0; column < std::min(radius, args.width); ++column) {
    window = window + columns.At(column);
  }
  for (int column = 0; column < args.width; ++column) {
    if (column + radius < args.width) window = window + columns.At(column + radius);
    if (column > radius) window = window - columns.At(column - radius - 1);
    const int64_t i = int64_t{y} * args.width + column;
    if (job.x[i] != job.x[i]) continue;
    const auto fit = FitWindow<double>(window, job.fit.variance_floor);
    const ScaleShift<float> local = {static_cast<float>(fit.scale), static_cast<float>(fit.shift)};
    ComparePixel(job, i, local, job.fit.local_grad, band);
  }
}

// Slides the columns down the band: those of scanline y hold y - radius to y + radius.
void CompareBandInWindows(const DepthJob& job, Band& band) {
  const DepthLossArgs& args = *job.args;
  ColumnMoments columns(args.width);
  const auto add_row = [&](int y, double sign) {
    if (y < 0 || y >= args.height) return;
    const int64_t at = int64_t{y} * args.width;
    columns.AddRow(job.x + at, args.prior.data + at, sign);
  };
  for (int y = band.first_row - args.window_radius; y < band.first_row + args.window_radius; ++y) {
    add_row(y, 1);
  }
  for (int y = band.first_row; y < band.end_row; ++y) {
    add_row(y + args.window_radius, 1);
    CompareRowInWindows(job, columns, y, band);
    add_row(y - args.window_radius, -1);
  }
}

// Compares all pixels with the view's fit, and those in the rectangle with its own as well.
void CompareBandInPatch(const DepthJob& job, Band& band) {
  const DepthLossArgs& args = *job.args;
  for (int y = band.first_row; y < band.end_row; ++y) {
    for (int column = 0; column < args.width; ++column) {
      const int64_t i = int64_t{y} * args.width + column;
      if (job.x[i] != job.x[i]) continue;
      const bool inside = IsInside(args.patch, column, y);
      ComparePixel(job, i, job.fit.patch, inside ? job.fit.local_grad : 0, band);
    }
  }
}

// Adds the bands in their order.
Band SumOf(const std::vector<Band>& bands) {
  Band all = {};
  for (const Band& band : bands) {
    all.view = all.view + band.view;
    all.patch = all.patch + band.patch;
    all.view_error += band.view_error;
    all.local_error += band.local_error;
  }
  return all;
}

// The gradients at a pixel are the weights over the counts, so they turn sums of errors into
// losses.
void StoreSums(const DepthLossArgs& args, const DepthFit& fit, const Band& all) {
  args.sums[kSumDepthView] = fit.view_grad * all.view_error;
  args.sums[kSumDepthLocal] = fit.local_grad * all.local_error;
  args.sums[kSumDepthPixels] = fit.usable ? all.view.count : 0;
  args.sums[kDepthScale] = fit.view.scale;
  args.sums[kDepthShift] = fit.view.shift;
  args.sums[kDepthSkipped] = fit.usable ? 0 : 1;
}

}  // namespace

void CpuBackend::DepthLoss(const DepthLossArgs& args) {
  if (failed()) return;
  const int64_t num_pixels = int64_t{args.width} * args.height;
  const std::unique_ptr<float[]> x(new float[num_pixels]);
  DepthJob job = {&args, x.get(), {}};
  std::vector<Band> bands((args.height + kBandRows - 1) / kBandRows);
  const auto num_bands = static_cast<int64_t>(bands.size());
  pool_.ParallelFor(num_bands, [&](int64_t i, int) {
    bands[i].first_row = static_cast<int>(i) * kBandRows;
    bands[i].end_row = std::min(args.height, bands[i].first_row + kBandRows);
    GatherBand(job, bands[i]);
  });
  // The fit needs the moments of all bands, the second pass needs the fit.
  const Band all = SumOf(bands);
  const bool in_windows = FitsWindows(args);
  job.fit =
      FitDepth(all.view, in_windows ? all.view : all.patch, args.view_weight, args.local_weight);
  std::fill_n(args.alpha_grad.data, num_pixels, 0.0f);
  std::fill_n(args.depth_grad.data, num_pixels, 0.0f);
  if (job.fit.usable) {
    pool_.ParallelFor(num_bands, [&](int64_t i, int) {
      in_windows ? CompareBandInWindows(job, bands[i]) : CompareBandInPatch(job, bands[i]);
    });
  }
  StoreSums(args, job.fit, SumOf(bands));
}

}  // namespace pepeseg
