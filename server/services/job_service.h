#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pepeseg/v1/job_service.grpc.pb.h"
#include "server/data/blob_store.h"
#include "server/jobs/supervisor.h"
#include "server/rpc/call_runner.h"
#include "server/services/estimate_training.h"
#include "server/store/store.h"

namespace pepeseg {

// Answers calls about trainings.
class JobServiceRpc final : public v1::JobService::CallbackService {
 public:
  // All must outlive it.
  struct Dependencies {
    Store& store;
    const BlobStore& blobs;
    Supervisor& supervisor;
    TrainingEstimator::Machine machine;
  };
  JobServiceRpc(const CallRunner& runner, const Dependencies& deps);

  PEPESEG_UNARY(TrainScene, v1::TrainSceneRequest, v1::Job)
  PEPESEG_UNARY(ListTrainingOptions, v1::ListTrainingOptionsRequest,
                v1::ListTrainingOptionsResponse)
  PEPESEG_UNARY(GetJob, v1::GetJobRequest, v1::Job)
  PEPESEG_UNARY(ListJobs, v1::ListJobsRequest, v1::ListJobsResponse)
  PEPESEG_UNARY(CancelJob, v1::CancelJobRequest, v1::Job)
  grpc::ServerWriteReactor<v1::JobEvent>* WatchJob(grpc::CallbackServerContext* call,
                                                   const v1::WatchJobRequest* request) override;
  PEPESEG_UNARY(EstimateTraining, v1::EstimateTrainingRequest, v1::EstimateTrainingResponse)

 private:
  // Returns FAILED_PRECONDITION, NOT_FOUND or INVALID_ARGUMENT unless the training can be queued:
  // the server has the programs that it asks for, the dataset is sealed, its files are there, and
  // held-out views are among them.
  absl::Status CheckRunnable(const WantedTraining& training) const;
  absl::Status CheckSealed(const SceneRef& scene, int64_t dataset) const;
  // Checks whether all files, those of a sealed dataset, are there: a damaged blob may have been
  // set aside since. FAILED_PRECONDITION names the first file that is missing, and says how many
  // are. Also updates the store, so that files that any upload of the project has brought again
  // count. Looks at sizes only; a training reads all bytes.
  absl::Status CheckFilesStored(const SceneRef& scene, int64_t dataset,
                                const std::vector<DatasetFileRecord>& files) const;

  const CallRunner& runner_;
  Store& store_;
  const BlobStore& blobs_;
  Supervisor& supervisor_;
  const TrainingEstimator estimator_;
};

}  // namespace pepeseg
