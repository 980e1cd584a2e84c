#pragma once

#include <cstdint>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/train/settings/estimate.h"
#include "core/train/settings/training_settings.h"
#include "kernels/backend.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/data/blob_store.h"
#include "server/store/store.h"

namespace pepeseg {

// A training as it would be queued.
struct WantedTraining {
  SceneRef scene;       // its key
  int64_t dataset = 0;  // number of the dataset in the scene
  TrainingSettings settings;
};

// Returns OK while the caller waits for the answer; else CANCELLED or DEADLINE_EXCEEDED.
using CheckWanted = absl::FunctionRef<absl::Status()>;

// Measures a dataset by the headers of its files, which the store keeps. A video counts as the
// frames that are taken from it, at a usual size. Reads the headers that the store does not have
// yet, of at most 48 photographs and 48 point files (ReadFileHeader bounds each), and calls
// `wanted` before each; further photographs are assumed to have the average size. INVALID_ARGUMENT
// names a photograph whose header was refused.
absl::StatusOr<DatasetSize> MeasureDataset(Store& store, const BlobStore& blobs,
                                           const WantedTraining& training, CheckWanted wanted);

// Memory and time that a worker needs, with a reserve.
struct WorkerShare {
  int64_t host_bytes = 0;  // 0: unknown
  int64_t seconds = 0;     // 0: unknown
};

// Estimates what trainings take. Thread safe; all calls block on the store and the disk.
class TrainingEstimator {
 public:
  // Where trainings run.
  struct Machine {
    Backend& backend;
    EstimateTools tools;
  };
  // All must outlive it.
  TrainingEstimator(Store& store, const BlobStore& blobs, const Machine& machine)
      : store_(store), blobs_(blobs), machine_(machine) {}

  // Returns what the training takes by MeasureDataset, with its errors.
  absl::StatusOr<v1::EstimateTrainingResponse> Estimate(const WantedTraining& training,
                                                        CheckWanted wanted) const;

  // Returns what the worker of a training needs. RESOURCE_EXHAUSTED with the bytes needed and
  // available: the training does not fit. Also returns the error of `wanted`, but no other: if
  // nothing can be estimated the share is unknown, and the job will report what is wrong.
  absl::StatusOr<WorkerShare> CheckFits(const WantedTraining& training, CheckWanted wanted) const;

  const EstimateTools& tools() const { return machine_.tools; }

 private:
  struct Estimated {
    v1::EstimateTrainingResponse response;
    bool is_measured = false;  // all durations are those of an earlier training on this machine
  };
  absl::StatusOr<Estimated> EstimateAll(const WantedTraining& training, CheckWanted wanted) const;

  Store& store_;
  const BlobStore& blobs_;
  const Machine machine_;
};

}  // namespace pepeseg
