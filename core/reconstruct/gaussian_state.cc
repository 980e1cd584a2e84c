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
      stride_(WithSlack(initial.count)),
      parameters_(backend, PlanesSize(stride_)),
      moment1_(backend, PlanesSize(stride_)),
      moment2_(backend, PlanesSize(stride_)),
      num_steps_(backend, count_) {
  ResetStats();
  allocated_ = !parameters_.empty() && !moment1_.empty() && !moment2_.empty();
  if (allocated_) UploadPlanes(0, initial.planes);
}

DensityStats GaussianState::stats() { return {grad_sum_.span(), num_visible_.span(), {}}; }

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
    parameters_.Download(plane, (first + k) * stride_);
  }
  return planes;
}

void GaussianState::UploadPlanes(int first, std::span<const float> planes) {
  const auto num_planes = static_cast<int64_t>(planes.size()) / std::max<int64_t>(1, count_);
  for (int64_t k = 0; k < num_planes; ++k) {
    parameters_.Upload(planes.subspan(k * count_, count_), (first + k) * stride_);
  }
}

std::vector<float> GaussianState::DownloadGradSums() const {
  std::vector<float> sums(static_cast<size_t>(count_));
  grad_sum_.Download(sums);
  return sums;
}

std::vector<int32_t> GaussianState::DownloadNumVisible() const {
  std::vector<int32_t> counts(static_cast<size_t>(count_));
  num_visible_.Download(counts);
  return counts;
}

void GaussianState::Gather(Buffer<float>& planes, Buffer<float>& spare,
                           DeviceSpan<const int32_t> source) {
  const int64_t new_stride = spare.size() / NumPlanes(sh_degree_);
  backend_.GatherRows(
      {source, Planes(planes), {spare.span().data, source.size, new_stride, sh_degree_}});
  std::swap(planes, spare);
}

bool GaussianState::Rearrange(std::span<const int32_t> source, std::span<const uint8_t> is_new) {
  const auto new_count = static_cast<int64_t>(source.size());
  const int64_t new_stride = new_count > stride_ ? WithSlack(new_count) : stride_;
  std::vector<int32_t> old_steps(static_cast<size_t>(count_)), steps(source.size());
  num_steps_.Download(old_steps);
  std::vector<int32_t> state_source(source.begin(), source.end());
  for (int64_t i = 0; i < new_count; ++i) {
    steps[i] = is_new[i] ? 0 : old_steps[source[i]];
    if (is_new[i]) state_source[i] = -1;
  }
  const Buffer<int32_t> from(backend_, source),
      state_from(backend_, std::span<const int32_t>(state_source));
  Buffer<float> spare[3];
  for (auto& buffer : spare) buffer = Buffer<float>(backend_, PlanesSize(new_stride));
  for (auto& buffer : spare) {
    if (buffer.empty()) return false;
  }
  Gather(parameters_, spare[0], from.span());
  Gather(moment1_, spare[1], state_from.span());
  Gather(moment2_, spare[2], state_from.span());
  count_ = new_count;
  stride_ = new_stride;
  num_steps_.Reserve(backend_, count_);
  num_steps_.Upload(steps);
  ResetStats();
  return true;
}

void GaussianState::ResetStats() {
  grad_sum_.Reserve(backend_, count_);
  num_visible_.Reserve(backend_, count_);
  grad_sum_.Zero();
  num_visible_.Zero();
}

void GaussianState::LimitOpacity(float opacity) {
  const float limit = std::log(opacity / (1 - opacity));
  std::vector<float> logits = DownloadPlanes(kOpacityPlane, 1);
  for (float& logit : logits) logit = std::min(logit, limit);
  UploadPlanes(kOpacityPlane, logits);
  const std::vector<float> zeros(static_cast<size_t>(count_), 0.0f);
  moment1_.Upload(zeros, kOpacityPlane * stride_);
  moment2_.Upload(zeros, kOpacityPlane * stride_);
}

}  // namespace pepeseg
