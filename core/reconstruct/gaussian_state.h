#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// All of a GaussianState, on the host.
struct GaussianRows {
  struct Shape {
    int64_t count = 0, sh_degree = 0;
  };
  Shape shape;
  std::vector<float> parameters, moment1, moment2;  // [NumPlanes(sh_degree), count]
  std::vector<int32_t> num_steps;                   // [count], as are the statistics
  std::vector<float> grad_sum;
  std::vector<int32_t> num_visible;
  std::vector<int32_t> refinable;  // [count], or empty while refinement is not open
};

// What stage one trains, in backend memory: the parameters with Adam's moments and step counts and
// the statistics of density control. Planes have slack, so that rows can come and go.
class GaussianState {
 public:
  GaussianState(Backend& backend, const Gaussians& initial);

  // What a state of the backend's memory takes at most that begins with `first` Gaussians and never
  // has more than `most`.
  static int64_t Bytes(int64_t first, int64_t most, int sh_degree);

  int64_t count() const { return count_; }
  int sh_degree() const { return sh_degree_; }
  bool allocated() const { return rows_.allocated; }  // false: the backend is out of memory
  GaussianPlanes parameters() { return Planes(rows_.parameters); }
  GaussianPlanes moment1() { return Planes(rows_.moment1); }
  GaussianPlanes moment2() { return Planes(rows_.moment2); }
  DeviceSpan<int32_t> num_steps() { return rows_.num_steps.span().Subspan(0, count_); }
  DensityStats stats();

  // Waits for the backend.
  Gaussians Download() const;
  GaussianRows DownloadRows() const;
  // Becomes what the rows say, whose degree must not be over this state's. False when the backend
  // is out of memory: nothing is left.
  bool Restore(const GaussianRows& rows);

  // Coefficients of higher degrees are gone from now on; their memory goes with the next
  // Rearrange.
  void KeepBandsTo(int sh_degree);

  // Row i becomes what row source[i] was; where is_new[i], its moments and step count start at 0.
  // Statistics start afresh. False when the backend is out of memory: nothing was changed.
  bool Rearrange(DeviceSpan<const int32_t> source, DeviceSpan<const uint8_t> is_new);

  // While refinement is open, 1 for a row that may yet be refined and 0 for others; rows that come
  // later are 0. False when the backend is out of memory.
  bool OpenRefinement();  // all rows that there are may be
  void CloseRefinement() { rows_.refinable = {}; }
  bool refinement_open() const { return !rows_.refinable.empty(); }
  DeviceSpan<int32_t> refinable() { return rows_.refinable.span().Subspan(0, count_); }

  // New rows behind the present ones, whose order and statistics stay: copies of rows `source` but
  // for the means and log scales, planes [6, stride] with stride >= source.size. False when the
  // backend is out of memory: nothing was changed.
  bool Append(DeviceSpan<const int32_t> source, DeviceSpan<const float> mean_log_scale);

  // Means and log scales, planes [6, count].
  void SetMeansAndLogScales(DeviceSpan<const float> planes);

  // No opacity is more than this from now on; the opacities' moments start at 0.
  void LimitOpacity(float opacity);
  // Opacities are multiplied by `factor`; moments stay.
  void FadeOpacity(float factor);

 private:
  struct Rows {
    int64_t stride = 0;  // room for this many Gaussians
    bool allocated = true;
    Buffer<float> parameters, moment1, moment2;  // [NumPlanes, stride]
    Buffer<int32_t> num_steps;                   // [stride], as are the statistics
    Buffer<float> grad_sum;
    Buffer<int32_t> num_visible;
    Buffer<int32_t> refinable;  // empty while refinement is not open
  };

  void ChangeOpacityLogits(absl::FunctionRef<float(float)> change);
  Rows Allocate(int64_t stride) const;  // all zero
  bool Grow(int64_t stride);            // rows stay as they are
  // [num_planes, count]
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
