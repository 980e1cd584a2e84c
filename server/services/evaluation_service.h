#pragma once

#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "server/data/blob_store.h"
#include "server/jobs/photograph_process.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Scores models, on the pool `evaluation`.
class EvaluationServiceRpc final : public v1::EvaluationService::CallbackService {
 public:
  // All must outlive it.
  EvaluationServiceRpc(const CallRunner& runner, ModelLoader& models, const BlobStore& blobs,
                       const PhotographProcess& photographs);

  grpc::ServerUnaryReactor* EvaluateModel(grpc::CallbackServerContext* call,
                                          const v1::EvaluateModelRequest* request,
                                          v1::EvaluateModelResponse* response) override;

 private:
  absl::Status Evaluate(const UnaryCall& call, const v1::EvaluateModelRequest& request,
                        v1::EvaluateModelResponse* response) const;

  const CallRunner& runner_;
  ModelLoader& models_;
  const BlobStore& blobs_;
  const PhotographProcess& photographs_;
};

}  // namespace pepeseg
