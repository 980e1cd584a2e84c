#pragma once

#include "pepeseg/v1/job_service.grpc.pb.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

struct UnaryRequest;

class JobServiceRpc final : public v1::JobService::CallbackService {
 public:
  explicit JobServiceRpc(const ServiceContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* TrainScene(grpc::CallbackServerContext* call,
                                       const v1::TrainSceneRequest* request,
                                       v1::Job* response) override;
  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* call,
                                   const v1::GetJobRequest* request, v1::Job* response) override;
  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* call,
                                     const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override;
  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* call,
                                      const v1::CancelJobRequest* request,
                                      v1::Job* response) override;
  grpc::ServerWriteReactor<v1::JobEvent>* WatchJob(grpc::CallbackServerContext* call,
                                                   const v1::WatchJobRequest* request) override;
  grpc::ServerUnaryReactor* EstimateTraining(grpc::CallbackServerContext* call,
                                             const v1::EstimateTrainingRequest* request,
                                             v1::EstimateTrainingResponse* response) override;

 private:
  absl::Status CheckSealed(const std::string& scene, int64_t dataset) const;
  // `traceparent`: of the call.
  absl::Status Train(const v1::TrainSceneRequest& request, const UnaryRequest& call,
                     v1::Job* response) const;

  const ServiceContext context_;
};

}  // namespace pepeseg
