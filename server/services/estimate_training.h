#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/api/convert.h"
#include "server/rpc/service_context.h"
#include "server/services/dataset_size.h"

namespace pepeseg {

// A training as it would be queued.
struct WantedTraining {
  std::string scene;
  int64_t dataset = 0;  // number
  TrainingSettings settings;
};

// Estimates by what MeasureDataset finds, with its errors.
absl::StatusOr<v1::EstimateTrainingResponse> EstimateTraining(const ServiceContext& context,
                                                              const WantedTraining& training,
                                                              CheckWanted wanted);

// What a worker is to be given, with a reserve; 0: nothing is known.
struct WorkerShare {
  int64_t host_bytes = 0;
  int64_t seconds = 0;
};

// RESOURCE_EXHAUSTED with need and have when the training does not fit; the error of `wanted`.
// Answers also where nothing can be estimated: the job then says what is wrong with which file.
absl::StatusOr<WorkerShare> CheckFits(const ServiceContext& context, const WantedTraining& training,
                                      CheckWanted wanted);

}  // namespace pepeseg
