#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// A copy of a GaussianState in host memory, as checkpoints store it.
struct GaussianRows {
  struct Shape {
    int64_t count = 0, sh_degree = 0;
  };
  Shape shape;
  std::vector<float> parameters, moment1, moment2;  // [NumPlanes(sh_degree), count]
  std::vector<int32_t> num_steps;                   // [count], as are the statistics
  std::vector<float> grad_sum, square_sum;
  std::vector<int32_t> num_visible;
  std::vector<int32_t> refinable;  // [count], or empty while refinement is not open
};

// The Gaussians that stage one trains (METHOD.md section 1), in backend memory: parameters, Adam's
// moments and step counts, and the statistics of density control. Values lie in planes [plane,
// stride], one number per Gaussian in each; the stride exceeds the count, so that Gaussians can be
// added without a new allocation. To be used by one thread at a time.
class GaussianState {
 public:
  GaussianState(Backend& backend, const Gaussians& initial);

  // Returns the largest size in bytes of a state that begins with `first` Gaussians and never has
  // more than `most`.
  static int64_t Bytes(int64_t first, int64_t most, int sh_degree);

  int64_t count() const { return count_; }
  int sh_degree() const { return sh_degree_; }
  bool allocated() const { return rows_.allocated; }  // false: the backend is out of memory
  GaussianPlanes parameters() { return Planes(rows_.parameters); }
  GaussianPlanes moment1() { return Planes(rows_.moment1); }
  GaussianPlanes moment2() { return Planes(rows_.moment2); }
  DeviceSpan<int32_t> num_steps() { return rows_.num_steps.span().Subspan(0, count_); }
  DensityStats stats();

  // Both wait for the backend.
  Gaussians Download() const;
  GaussianRows DownloadRows() const;
  // Replaces the state by `rows`, whose SH degree must not exceed this state's. Returns false when
  // the backend is out of memory; the state is then empty.
  bool Restore(const GaussianRows& rows);

  // Removes the coefficients of degrees over `sh_degree`. Their memory is freed by the next
  // Rearrange.
  void LimitShDegree(int sh_degree);

  // Replaces Gaussian i by a copy of Gaussian source[i], for i in [0, source.size). Where is_new[i]
  // is set, its moments and step count become 0. All statistics become 0. Returns false, with
  // nothing changed, when the backend is out of memory.
  bool Rearrange(DeviceSpan<const int32_t> source, DeviceSpan<const uint8_t> is_new);

  // Removes the Gaussians whose mean, in the world, is in a region, and none if all are there. All
  // statistics become 0 if there are any. Waits for the backend. Calls `in_region` on several
  // threads. Returns how many were removed, or -1, with nothing changed, when the backend is out of
  // memory.
  int64_t Remove(absl::FunctionRef<bool(const Eigen::Vector3f&)> in_region);

  // While refinement is open, refinable() is 1 for a Gaussian that may still be refined, else 0.
  // OpenRefinement sets it to 1 for all present Gaussians; Gaussians that Append adds get 0.
  // Returns false when the backend is out of memory.
  bool OpenRefinement();
  void CloseRefinement() { rows_.refinable = {}; }
  bool refinement_open() const { return !rows_.refinable.empty(); }
  DeviceSpan<int32_t> refinable() { return rows_.refinable.span().Subspan(0, count_); }

  // Appends copies of the Gaussians `source` with new means and log scales: planes [6, stride],
  // stride >= source.size. Order and statistics of the present ones stay. Returns false, with
  // nothing changed, when the backend is out of memory.
  bool Append(DeviceSpan<const int32_t> source, DeviceSpan<const float> mean_log_scale);

  // Sets the means and log scales of all Gaussians: planes [6, count].
  void SetMeansAndLogScales(DeviceSpan<const float> planes);

  // Limits all opacities to `opacity`, in (0, 1), and sets the opacities' moments to 0.
  void LimitOpacity(float opacity);
  // Multiplies all opacities by `factor`, in (0, 1]; moments stay.
  void FadeOpacity(float factor);

 private:
  struct Rows {
    int64_t stride = 0;  // capacity, Gaussians
    bool allocated = true;
    Buffer<float> parameters, moment1, moment2;  // [NumPlanes, stride]
    Buffer<int32_t> num_steps;                   // [stride], as are the statistics
    Buffer<float> grad_sum, square_sum;
    Buffer<int32_t> num_visible;
    Buffer<int32_t> refinable;  // empty while refinement is not open
  };

  void ChangeOpacityLogits(absl::FunctionRef<float(float)> change);
  Rows Allocate(int64_t stride) const;  // all zero
  bool Grow(int64_t stride);            // same Gaussians, larger stride; false: out of memory
  // Planes `first` to first + num_planes - 1, packed: [num_planes, count].
  std::vector<float> DownloadPlanes(const Buffer<float>& buffer, int first, int num_planes) const;
  void UploadPlanes(Buffer<float>& buffer, int first, std::span<const float> planes);
  GaussianPlanes Planes(Buffer<float>& buffer) const {
    return {buffer.span().data, count_, rows_.stride, sh_degree_};
  }

  Backend& backend_;
  int sh_degree_;
  int64_t count_ = 0;
  Rows rows_;
};

}  // namespace pepeseg
