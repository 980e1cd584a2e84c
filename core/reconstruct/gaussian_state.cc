#include "core/reconstruct/gaussian_state.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace pepeseg {
namespace {

int64_t WithSlack(int64_t count) { return count + count / 4 + 1024; }

}  // namespace

GaussianState::GaussianState(Backend& backend, const Gaussians& initial)
    : backend_(backend),
      sh_degree_(initial.sh_degree),
      count_(initial.count),
      rows_(Allocate(WithSlack(initial.count))) {
  if (allocated()) UploadPlanes(rows_.parameters, 0, initial.planes);
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
  rows.num_visible = Buffer<int32_t>(backend_, stride);
  rows.allocated = rows.allocated && !rows.num_steps.empty() && !rows.grad_sum.empty() &&
                   !rows.num_visible.empty();
  return rows;
}

DensityStats GaussianState::stats() {
  return {
      rows_.grad_sum.span().Subspan(0, count_), rows_.num_visible.span().Subspan(0, count_), {}};
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
  rows.num_visible.resize(count);
  rows_.num_steps.Download(rows.num_steps);
  rows_.grad_sum.Download(rows.grad_sum);
  rows_.num_visible.Download(rows.num_visible);
  return rows;
}

bool GaussianState::Restore(const GaussianRows& rows) {
  assert(rows.shape.sh_degree == sh_degree_);
  rows_ = {};  // first, so that both never stand side by side
  count_ = rows.shape.count;
  rows_ = Allocate(WithSlack(count_));
  if (!allocated()) return false;
  UploadPlanes(rows_.parameters, 0, rows.parameters);
  UploadPlanes(rows_.moment1, 0, rows.moment1);
  UploadPlanes(rows_.moment2, 0, rows.moment2);
  rows_.num_steps.Upload(rows.num_steps);
  rows_.grad_sum.Upload(rows.grad_sum);
  rows_.num_visible.Upload(rows.num_visible);
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

bool GaussianState::Rearrange(DeviceSpan<const int32_t> source, DeviceSpan<const uint8_t> is_new) {
  const int64_t new_count = source.size;
  Rows next = Allocate(new_count > rows_.stride ? WithSlack(new_count) : rows_.stride);
  if (!next.allocated) return false;
  const auto planes_of = [&](Buffer<float>& buffer) {
    return GaussianPlanes{buffer.span().data, new_count, next.stride, sh_degree_};
  };
  backend_.GatherRows(
      {.source = source, .from = Planes(rows_.parameters), .to = planes_of(next.parameters)});
  backend_.GatherRows({.source = source,
                       .is_zero = is_new,
                       .from = Planes(rows_.moment1),
                       .to = planes_of(next.moment1)});
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

void GaussianState::SetMeansAndLogScales(DeviceSpan<const float> planes) {
  constexpr int kNumPlanes = kRotationPlane - kMeanPlane;
  for (int k = 0; k < kNumPlanes; ++k) {
    backend_.Copy(parameters().Plane(kMeanPlane + k), planes.Subspan(k * count_, count_).data,
                  static_cast<size_t>(count_) * sizeof(float));
  }
}

void GaussianState::LimitOpacity(float opacity) {
  const float limit = std::log(opacity / (1 - opacity));
  std::vector<float> logits = DownloadPlanes(rows_.parameters, kOpacityPlane, 1);
  for (float& logit : logits) logit = std::min(logit, limit);
  UploadPlanes(rows_.parameters, kOpacityPlane, logits);
  const std::vector<float> zeros(static_cast<size_t>(count_), 0.0f);
  rows_.moment1.Upload(zeros, kOpacityPlane * rows_.stride);
  rows_.moment2.Upload(zeros, kOpacityPlane * rows_.stride);
}

}  // namespace pepeseg
