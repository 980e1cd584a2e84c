#include "core/reconstruct/gaussian_state.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/on_threads.h"
#include "kernels/buffer.h"

namespace pepeseg {
namespace {

// Stride for `count` Gaussians: a quarter more, so that not every round allocates.
int64_t WithSlack(int64_t count) { return count + count / 4 + 1024; }

// The first `count` elements; an empty span of an empty buffer.
DeviceSpan<int32_t> FirstOf(Buffer<int32_t>& buffer, int64_t count) {
  return buffer.empty() ? DeviceSpan<int32_t>() : buffer.span().Subspan(0, count);
}

// Returns the logit of factor * sigmoid(logit), factor in (0, 1], without computing the opacity: in
// single precision that is 1 from a logit of 17 on and 0 below -88, and the logit of either is not
// finite. With x = logit and e = exp(-|x|):
//   x < 0:  x + log(factor) - log(1 + (1 - factor) e)
//   else:   log(factor) - log(1 - factor + e)
float FadedLogit(float logit, float factor) {
  if (factor >= 1) return logit;
  const double kept = factor, lost = 1 - kept, x = logit, small = std::exp(-std::abs(x));
  return static_cast<float>(x < 0 ? x + std::log(kept) - std::log1p(lost * small)
                                  : std::log(kept) - std::log(lost + small));
}

}  // namespace

GaussianState::GaussianState(Backend& backend, const Gaussians& initial)
    : backend_(backend),
      sh_degree_(initial.sh_degree),
      count_(initial.count),
      rows_(Allocate(WithSlack(initial.count))) {
  if (allocated()) UploadPlanes(rows_.parameters, 0, initial.planes);
}

int64_t GaussianState::Bytes(int64_t first, int64_t most, int sh_degree) {
  // The first stride is kept as long as it suffices.
  const int64_t stride = most <= WithSlack(first) ? WithSlack(first) : WithSlack(most);
  const Rows rows;
  return stride * (NumPlanes(sh_degree) * BytesOfRow(rows.parameters, rows.moment1, rows.moment2) +
                   BytesOfRow(rows.num_steps, rows.grad_sum, rows.square_sum, rows.num_visible));
}

GaussianState::Rows GaussianState::Allocate(int64_t stride) const {
  Rows rows;
  rows.stride = stride;
  for (Buffer<float>* planes : {&rows.parameters, &rows.moment1, &rows.moment2}) {
    *planes = Buffer<float>(backend_, NumPlanes(sh_degree_) * stride);
    rows.allocated = rows.allocated && !planes->empty();
  }
  rows.num_steps = Buffer<int32_t>(backend_, stride);
  rows.grad_sum = Buffer<float>(backend_, stride);
  rows.square_sum = Buffer<float>(backend_, stride);
  rows.num_visible = Buffer<int32_t>(backend_, stride);
  rows.allocated = rows.allocated && !rows.num_steps.empty() && !rows.grad_sum.empty() &&
                   !rows.square_sum.empty() && !rows.num_visible.empty();
  return rows;
}

DensityStats GaussianState::stats() {
  return {.mean2d_grad_sum = rows_.grad_sum.span().Subspan(0, count_),
          .square_sum = rows_.square_sum.span().Subspan(0, count_),
          .num_visible = rows_.num_visible.span().Subspan(0, count_),
          .max_radius = {}};
}

Gaussians GaussianState::Download() const {
  Gaussians out;
  out.count = count_;
  out.sh_degree = sh_degree_;
  out.planes = DownloadPlanes(rows_.parameters, 0, NumPlanes(sh_degree_));
  return out;
}

GaussianRows GaussianState::DownloadRows() const {
  const int num_planes = NumPlanes(sh_degree_);
  GaussianRows rows;
  rows.shape = {count_, sh_degree_};
  rows.parameters = DownloadPlanes(rows_.parameters, 0, num_planes);
  rows.moment1 = DownloadPlanes(rows_.moment1, 0, num_planes);
  rows.moment2 = DownloadPlanes(rows_.moment2, 0, num_planes);
  const auto count = static_cast<size_t>(count_);
  rows.num_steps.resize(count);
  rows.grad_sum.resize(count);
  rows.square_sum.resize(count);
  rows.num_visible.resize(count);
  rows_.num_steps.Download(rows.num_steps);
  rows_.grad_sum.Download(rows.grad_sum);
  rows_.square_sum.Download(rows.square_sum);
  rows_.num_visible.Download(rows.num_visible);
  if (!refinement_open()) return rows;
  rows.refinable.resize(count);
  rows_.refinable.Download(rows.refinable);
  return rows;
}

// The stride is chosen again, so that it may differ from that of the run that saved the rows; no
// result depends on it.
bool GaussianState::Restore(const GaussianRows& rows) {
  assert(rows.shape.sh_degree <= sh_degree_);
  rows_ = {};  // frees the old state first: memory need not hold both
  sh_degree_ = static_cast<int>(rows.shape.sh_degree);
  count_ = rows.shape.count;
  rows_ = Allocate(WithSlack(count_));
  if (!allocated()) return false;
  UploadPlanes(rows_.parameters, 0, rows.parameters);
  UploadPlanes(rows_.moment1, 0, rows.moment1);
  UploadPlanes(rows_.moment2, 0, rows.moment2);
  rows_.num_steps.Upload(rows.num_steps);
  rows_.grad_sum.Upload(rows.grad_sum);
  rows_.square_sum.Upload(rows.square_sum);
  rows_.num_visible.Upload(rows.num_visible);
  if (rows.refinable.empty()) return true;
  if (!OpenRefinement()) return false;
  rows_.refinable.Upload(rows.refinable);
  return true;
}

std::vector<float> GaussianState::DownloadPlanes(const Buffer<float>& buffer, int first,
                                                 int num_planes) const {
  std::vector<float> planes(static_cast<size_t>(num_planes * count_));
  for (int k = 0; k < num_planes; ++k) {
    const std::span<float> plane(planes.data() + k * count_, static_cast<size_t>(count_));
    buffer.Download(plane, (first + k) * rows_.stride);
  }
  return planes;
}

void GaussianState::UploadPlanes(Buffer<float>& buffer, int first, std::span<const float> planes) {
  const auto num_planes = static_cast<int64_t>(planes.size()) / std::max<int64_t>(1, count_);
  for (int64_t k = 0; k < num_planes; ++k) {
    buffer.Upload(planes.subspan(k * count_, count_), (first + k) * rows_.stride);
  }
}

// Higher degrees are the last planes of each buffer, so that a smaller degree hides them.
void GaussianState::LimitShDegree(int sh_degree) { sh_degree_ = std::min(sh_degree_, sh_degree); }

int64_t GaussianState::Remove(absl::FunctionRef<bool(const Eigen::Vector3f&)> in_region) {
  const std::vector<float> means = DownloadPlanes(rows_.parameters, kMeanPlane, 3);
  std::vector<uint8_t> is_removed(static_cast<size_t>(count_));
  constexpr int64_t kBlock = 8192;  // Gaussians
  OnThreads(static_cast<size_t>((count_ + kBlock - 1) / kBlock), [&](size_t block) {
    const int64_t first = static_cast<int64_t>(block) * kBlock;
    for (int64_t i = first; i < std::min(count_, first + kBlock); ++i) {
      is_removed[i] = in_region({means[i], means[count_ + i], means[2 * count_ + i]}) ? 1 : 0;
    }
  });
  std::vector<int32_t> kept;
  kept.reserve(static_cast<size_t>(count_));
  for (int64_t i = 0; i < count_; ++i) {
    if (is_removed[i] == 0) kept.push_back(static_cast<int32_t>(i));
  }
  const int64_t num_removed = count_ - static_cast<int64_t>(kept.size());
  if (num_removed == 0 || kept.empty()) return 0;
  const Buffer<int32_t> source(backend_, std::span<const int32_t>(kept));
  const Buffer<uint8_t> none_is_new(backend_, static_cast<int64_t>(kept.size()));
  if (source.empty() || none_is_new.empty()) return -1;
  return Rearrange(source.span(), none_is_new.span()) ? num_removed : -1;
}

// Gathers into a second set of buffers, whose statistics are zero, and swaps. Children inherit
// whether they are refinable but not moments and step counts.
bool GaussianState::Rearrange(DeviceSpan<const int32_t> source, DeviceSpan<const uint8_t> is_new) {
  const int64_t new_count = source.size;
  Rows next = Allocate(new_count > rows_.stride ? WithSlack(new_count) : rows_.stride);
  if (!next.allocated) return false;
  if (!rows_.refinable.empty()) {
    next.refinable = Buffer<int32_t>(backend_, next.stride);
    if (next.refinable.empty()) return false;
  }
  const auto planes_of = [&](Buffer<float>& buffer) {
    return GaussianPlanes{buffer.span().data, new_count, next.stride, sh_degree_};
  };
  backend_.GatherRows(
      {.source = source, .from = Planes(rows_.parameters), .to = planes_of(next.parameters)});
  backend_.GatherRows({.source = source,
                       .is_zero = is_new,
                       .from = Planes(rows_.moment1),
                       .to = planes_of(next.moment1),
                       .number_from = rows_.refinable.span(),
                       .number_to = FirstOf(next.refinable, new_count)});
  backend_.GatherRows({.source = source,
                       .is_zero = is_new,
                       .from = Planes(rows_.moment2),
                       .to = planes_of(next.moment2),
                       .number_from = num_steps(),
                       .number_to = next.num_steps.span().Subspan(0, new_count)});
  rows_ = std::move(next);
  count_ = new_count;
  return true;
}

bool GaussianState::OpenRefinement() {
  rows_.refinable = Buffer<int32_t>(backend_, rows_.stride);
  if (rows_.refinable.empty()) return false;
  rows_.refinable.Upload(std::vector<int32_t>(static_cast<size_t>(count_), 1));
  return true;
}

// Copies plane by plane, because the stride changes the place of each plane.
bool GaussianState::Grow(int64_t stride) {
  Rows next = Allocate(stride);
  if (!next.allocated) return false;
  if (!rows_.refinable.empty()) {
    next.refinable = Buffer<int32_t>(backend_, stride);
    if (next.refinable.empty()) return false;
  }
  const auto copy = [&]<class T>(Buffer<T>& from, Buffer<T>& to, int num_planes) {
    // `refinable` has no buffer outside refinement.
    for (int64_t k = 0; k < num_planes && !from.empty(); ++k) {
      backend_.Copy(to.span().data + k * stride, from.span().data + k * rows_.stride,
                    static_cast<size_t>(count_) * sizeof(T));
    }
  };
  const int num_planes = NumPlanes(sh_degree_);
  copy(rows_.parameters, next.parameters, num_planes);
  copy(rows_.moment1, next.moment1, num_planes);
  copy(rows_.moment2, next.moment2, num_planes);
  copy(rows_.num_steps, next.num_steps, 1);
  copy(rows_.grad_sum, next.grad_sum, 1);
  copy(rows_.square_sum, next.square_sum, 1);
  copy(rows_.num_visible, next.num_visible, 1);
  copy(rows_.refinable, next.refinable, 1);
  rows_ = std::move(next);
  return true;
}

// Gathers within the same buffers: sources lie below the old count, targets above it, so that they
// do not overlap.
bool GaussianState::Append(DeviceSpan<const int32_t> source,
                           DeviceSpan<const float> mean_log_scale) {
  const int64_t num_new = source.size, first = count_;
  if (num_new == 0) return true;
  if (first + num_new > rows_.stride && !Grow(WithSlack(first + num_new))) return false;
  const Buffer<uint8_t> all(backend_, std::vector<uint8_t>(static_cast<size_t>(num_new), 1));
  if (all.empty()) return false;
  const auto gather = [&](Buffer<float>& buffer, DeviceSpan<const uint8_t> is_zero) {
    const GaussianPlanes from = Planes(buffer);
    backend_.GatherRows({.source = source,
                         .is_zero = is_zero,
                         .from = from,
                         .to = {from.data + first, num_new, from.stride, sh_degree_}});
  };
  // The new Gaussians copy all parameters of their sources; moments and counts start at zero.
  gather(rows_.parameters, {});
  gather(rows_.moment1, all.span());
  gather(rows_.moment2, all.span());
  const auto zero = [&]<class T>(Buffer<T>& buffer) {
    if (buffer.empty()) return;
    backend_.Zero(buffer.span().data + first, static_cast<size_t>(num_new) * sizeof(T));
  };
  zero(rows_.num_steps);
  zero(rows_.grad_sum);
  zero(rows_.square_sum);
  zero(rows_.num_visible);
  zero(rows_.refinable);
  constexpr int kNumPlanes = kRotationPlane - kMeanPlane;
  const int64_t stride = mean_log_scale.size / kNumPlanes;
  for (int k = 0; k < kNumPlanes; ++k) {
    backend_.Copy(rows_.parameters.span().data + (kMeanPlane + k) * rows_.stride + first,
                  mean_log_scale.data + k * stride, static_cast<size_t>(num_new) * sizeof(float));
  }
  count_ += num_new;
  return true;
}

// The mean and log-scale planes are the first six of the parameters.
void GaussianState::SetMeansAndLogScales(DeviceSpan<const float> planes) {
  constexpr int kNumPlanes = kRotationPlane - kMeanPlane;
  for (int k = 0; k < kNumPlanes; ++k) {
    backend_.Copy(parameters().Plane(kMeanPlane + k), planes.Subspan(k * count_, count_).data,
                  static_cast<size_t>(count_) * sizeof(float));
  }
}

void GaussianState::FadeOpacity(float factor) {
  ChangeOpacityLogits([factor](float logit) { return FadedLogit(logit, factor); });
}

void GaussianState::LimitOpacity(float opacity) {
  const float limit = std::log(opacity / (1 - opacity));
  ChangeOpacityLogits([limit](float logit) { return std::min(logit, limit); });
  const std::vector<float> zeros(static_cast<size_t>(count_), 0.0f);
  // As in 3DGS, Adam starts again for the opacities: old moments would push them straight back.
  rows_.moment1.Upload(zeros, kOpacityPlane * rows_.stride);
  rows_.moment2.Upload(zeros, kOpacityPlane * rows_.stride);
}

// Opacities change on the host: one plane down and up, once in a round of density control.
void GaussianState::ChangeOpacityLogits(absl::FunctionRef<float(float)> change) {
  std::vector<float> logits = DownloadPlanes(rows_.parameters, kOpacityPlane, 1);
  for (float& logit : logits) logit = change(logit);
  UploadPlanes(rows_.parameters, kOpacityPlane, logits);
}

}  // namespace pepeseg
