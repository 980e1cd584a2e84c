#include "core/reconstruct/gaussian_state.h"

#include <algorithm>
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
  if (allocated()) UploadPlanes(0, initial.planes);
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
  out.planes = DownloadPlanes(0, NumPlanes(sh_degree_));
  return out;
}

std::vector<float> GaussianState::DownloadPlanes(int first, int num_planes) const {
  std::vector<float> planes(static_cast<size_t>(num_planes * count_));
  for (int k = 0; k < num_planes; ++k) {
    const std::span<float> plane(planes.data() + k * count_, static_cast<size_t>(count_));
    rows_.parameters.Download(plane, (first + k) * rows_.stride);
  }
  return planes;
}

void GaussianState::UploadPlanes(int first, std::span<const float> planes) {
  const auto num_planes = static_cast<int64_t>(planes.size()) / std::max<int64_t>(1, count_);
  for (int64_t k = 0; k < num_planes; ++k) {
    rows_.parameters.Upload(planes.subspan(k * count_, count_), (first + k) * rows_.stride);
  }
}

std::vector<float> GaussianState::DownloadGradSums() const {
  std::vector<float> sums(static_cast<size_t>(count_));
  rows_.grad_sum.Download(sums);
  return sums;
}

std::vector<int32_t> GaussianState::DownloadNumVisible() const {
  std::vector<int32_t> counts(static_cast<size_t>(count_));
  rows_.num_visible.Download(counts);
  return counts;
}

bool GaussianState::Rearrange(std::span<const int32_t> source, std::span<const uint8_t> is_new) {
  const auto new_count = static_cast<int64_t>(source.size());
  Rows next = Allocate(new_count > rows_.stride ? WithSlack(new_count) : rows_.stride);
  if (!next.allocated) return false;
  std::vector<int32_t> old_steps(static_cast<size_t>(count_)), steps(source.size());
  rows_.num_steps.Download(old_steps);
  std::vector<int32_t> state_source(source.begin(), source.end());
  for (int64_t i = 0; i < new_count; ++i) {
    steps[i] = is_new[i] ? 0 : old_steps[source[i]];
    if (is_new[i]) state_source[i] = -1;
  }
  next.num_steps.Upload(steps);
  const Buffer<int32_t> from(backend_, source);
  const Buffer<int32_t> state_from(backend_, std::span<const int32_t>(state_source));
  const auto gather = [&](Buffer<float>& old_planes, Buffer<float>& planes,
                          DeviceSpan<const int32_t> rows) {
    backend_.GatherRows(
        {rows, Planes(old_planes), {planes.span().data, new_count, next.stride, sh_degree_}});
  };
  gather(rows_.parameters, next.parameters, from.span());
  gather(rows_.moment1, next.moment1, state_from.span());
  gather(rows_.moment2, next.moment2, state_from.span());
  rows_ = std::move(next);
  count_ = new_count;
  return true;
}

void GaussianState::LimitOpacity(float opacity) {
  const float limit = std::log(opacity / (1 - opacity));
  std::vector<float> logits = DownloadPlanes(kOpacityPlane, 1);
  for (float& logit : logits) logit = std::min(logit, limit);
  UploadPlanes(kOpacityPlane, logits);
  const std::vector<float> zeros(static_cast<size_t>(count_), 0.0f);
  rows_.moment1.Upload(zeros, kOpacityPlane * rows_.stride);
  rows_.moment2.Upload(zeros, kOpacityPlane * rows_.stride);
}

}  // namespace pepeseg
