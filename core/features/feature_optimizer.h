#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/features/centroid_term.h"
#include "core/features/checkpoint.h"
#include "core/features/options.h"
#include "core/features/perception_term.h"
#include "core/features/preparation.h"
#include "core/features/row_chunk.h"
#include "kernels/backend.h"

namespace pepeseg {

// The steps that a schedule skips: the `num` steps after the first `num_done`. 0: none.
struct LeftOutSteps {
  int num_done = 0;
  int num = 0;  // at most the steps that remain after num_done
};

// Returns the share of a learning rate's fall over `num_steps` that the step after `done` others
// has reached, [0, 1]. The fall is even in steps. If steps are left out, the rest of the fall is
// spread evenly over the steps that remain after num_done, so that the rate does not jump and still
// ends where it would.
inline double ShareOfFall(int done, int num_steps, const LeftOutSteps& left_out) {
  if (done <= left_out.num_done) return static_cast<double>(done) / num_steps;
  const int planned = num_steps - left_out.num_done, remaining = planned - left_out.num;
  if (done >= left_out.num_done + remaining) return 1;
  return (left_out.num_done + static_cast<double>(done - left_out.num_done) * planned / remaining) /
         num_steps;
}

// Returns the number of steps that stage two does at once: views_at_once of the options or, where
// that is 0, at most two, as the device has branches for (Backend::num_branches), and one of more
// than half a million Gaussians.
int FeatureStepsAtOnce(int num_branches, int64_t num_gaussians, const FeatureOptions& options);

// Returns whether all 32 numbers of a Gaussian are 0. rows: [num_gaussians, 32].
bool IsZero(std::span<const float> rows, int64_t gaussian);

// Returns random features to begin with, [num_gaussians, 32]. Takes a while, uses no device.
std::vector<float> InitialFeatures(int64_t num_gaussians, const FeatureOptions& options);

// Features, gate and optimiser (lazy Adam, see FeatureState) in backend memory, the losses, and the
// update of one batch. Not thread safe.
class FeatureOptimizer {
 public:
  // The backend and `prepared` must outlive it. initial: see InitialFeatures.
  FeatureOptimizer(Backend& backend, const PreparedFeatures& prepared,
                   std::span<const float> initial, const FeatureOptions& options);
  FeatureOptimizer(const FeatureOptimizer&) = delete;
  FeatureOptimizer& operator=(const FeatureOptimizer&) = delete;

  int64_t num_gaussians() const { return num_gaussians_; }

  // Shortens the schedule: the learning rate falls the faster in the remaining steps. See
  // ShareOfFall.
  void LeaveOut(const LeftOutSteps& steps);

  // Number of steps that Train takes at most.
  int steps_at_once() const { return static_cast<int>(buffers_.size()); }
  // Queues steps, which are done at once, and waits for nothing. At most kMaxUnreadFeatureSteps
  // steps may lie between two calls of ReadLosses.
  void Train(std::span<const RowChunk::Step> steps);
  // Ends smoothing: from the next step on, each Gaussian learns a feature of its own. It begins
  // with the smoothed one, where a neighbour has been touched by a sample. Waits for the device.
  void EndSmoothing();
  // Returns whether centroids are refreshed before this step, counted from 0.
  bool CentroidsAreDue(int step) const { return centroids_.Due(step); }
  // Clusters a view by the features, smoothed unless smoothing has ended, for the centroid term if
  // that is due before this step. Waits for the device.
  absl::Status RefreshCentroids(int step);
  // Returns the losses of the steps since the last call, each before its update. Waits for the
  // device.
  std::vector<double> ReadLosses();

  FeatureRowsState Save() const;
  CentroidState SaveCentroids() const { return centroids_.Save(); }
  // Continues from the state saved after `step` updates, which must be of as many Gaussians.
  // DATA_LOSS: see CentroidTerm::Restore.
  absl::Status Restore(const FeatureRowsState& rows, const CentroidState& centroids, int step);

  // Brings all features up to date and fills field.features and field.gate. The features are
  // normalised. Those that no sample ever touched, and all unless smoothing has ended, are smoothed
  // over all neighbours. A Gaussian of which no neighbour was ever touched gets the feature 0,
  // which is similar to nothing.
  void Export(FeatureField& field);
  // Does the same and leaves the state as it is: features that are brought up to date in between
  // get other last bits than those that are not.
  void ExportUnchanged(FeatureField& field);

 private:
  // Memory of a step next to others.
  struct StepBuffers {
    Buffer<float> smoothed, inv_length;  // [N, 32], [N]: see SmoothFeaturesArgs
    // The batch: [pixels, 32] and [Gaussians that it reaches, 32].
    Buffer<float> pixel_features, pixel_grad, sum_grad;
    Buffer<float> gate_grad;  // see NumGateNumbers
  };
  // Returns the kind of a step, in [0, kNumKinds). Steps of one kind run the same ops.
  int KindOf(const RowChunk::Step& step) const;
  void QueueOps(std::span<const RowChunk::Step> steps);
  // Sets the size of the batch's buffers. The gradients of unlabelled pixels become 0.
  void ReserveBatch(const RowChunk::Step& step, StepBuffers& of_step);
  // Queues the ops from smoothing to the gradients. unread_step: slot of the losses.
  void QueueGradients(const RowChunk::Step& step, StepBuffers& of_step, int unread_step);
  void QueueUpdate(const RowChunk::Step& step, StepBuffers& of_step);
  void Upload(const FeatureRowsState& rows);
  // Smooths all features over the drawn neighbours into the buffer that it returns.
  const Buffer<float>& SmoothAll(DeviceSpan<const float> features, uint32_t drawn);
  // Returns all features, up to date; 0 where no sample has touched the Gaussian yet.
  std::vector<float> TouchedFeatures();
  FeatureState State() {
    return {features_.span(), moment1_.span(), moment2_.span(), last_step_.span()};
  }

  Backend& backend_;
  int64_t num_gaussians_;  // N
  const NeighborGraph graph_;
  const FeatureOptions options_;
  CentroidTerm centroids_;
  PerceptionTerm perception_{backend_, options_.perception_weight};
  const std::array<LossTerm*, 2> terms_ = {&centroids_, &perception_};
  int step_ = 0;  // updates done
  bool smooths_;  // false after EndSmoothing
  FeatureRates rates_;
  Buffer<float> correction_;                          // [num_steps + 1] see FeatureRates
  Buffer<float> features_, moment1_, moment2_;        // [N, 32]
  Buffer<int32_t> last_step_;                         // [N]
  Buffer<float> gate_, gate_moment1_, gate_moment2_;  // see NumGateNumbers
  std::vector<StepBuffers> buffers_;                  // of the steps that are done at once
  Buffer<double> sums_;                               // [kMaxUnreadFeatureSteps, kNumPairLossSums]
  int num_unread_ = 0;                                // steps since the last ReadLosses
};

}  // namespace pepeseg
