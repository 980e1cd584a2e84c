#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// What stage one trains, in backend memory: the parameters with Adam's moments and step counts and
// the statistics of density control. Planes have slack, so that rows can come and go.
class GaussianState {
 public:
  GaussianState(Backend& backend, const Gaussians& initial);

  int64_t count() const { return count_; }
  bool allocated() const { return allocated_; }  // false: the backend is out of memory
  GaussianPlanes parameters() { return Planes(parameters_); }
  GaussianPlanes moment1() { return Planes(moment1_); }
  GaussianPlanes moment2() { return Planes(moment2_); }
  DeviceSpan<int32_t> num_steps() { return num_steps_.span(); }
  DensityStats stats();

  // Waits for the backend.
  Gaussians Download() const;
  // Parameter planes [num_planes, count] from `first` on.
  std::vector<float> DownloadPlanes(int first, int num_planes) const;
  void UploadPlanes(int first, std::span<const float> planes);
  std::vector<float> DownloadGradSums() const;
  std::vector<int32_t> DownloadNumVisible() const;

  // Row i becomes what row source[i] was; where is_new[i], its moments and step count start at 0.
  // Statistics start afresh. False when the backend is out of memory: nothing was changed.
  bool Rearrange(std::span<const int32_t> source, std::span<const uint8_t> is_new);

  // No opacity is more than this from now on; the opacities' moments start at 0.
  void LimitOpacity(float opacity);

 private:
  GaussianPlanes Planes(Buffer<float>& buffer) const {
    return {buffer.span().data, count_, stride_, sh_degree_};
  }
  int64_t PlanesSize(int64_t stride) const { return NumPlanes(sh_degree_) * stride; }
  void Gather(Buffer<float>& planes, Buffer<float>& spare, DeviceSpan<const int32_t> source);
  void ResetStats();

  Backend& backend_;
  int sh_degree_;
  int64_t count_ = 0;
  int64_t stride_ = 0;
  bool allocated_ = true;
  Buffer<float> parameters_, moment1_, moment2_;  // [NumPlanes, stride]
  Buffer<int32_t> num_steps_;                     // [count], as are the statistics
  Buffer<float> grad_sum_;
  Buffer<int32_t> num_visible_;
};

}  // namespace pepeseg
