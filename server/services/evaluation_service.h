#pragma once

#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Scores models, on the pool `evaluation`.
class EvaluationServiceRpc final : public v1::EvaluationService::CallbackService {
 public:
  // Both must outlive it.
  EvaluationServiceRpc(const CallRunner& runner, ModelLoader& models);

  grpc::ServerUnaryReactor* EvaluateModel(grpc::CallbackServerContext* call,
                                          const v1::EvaluateModelRequest* request,
                                          v1::EvaluateModelResponse* response) override;

 private:
  absl::Status Evaluate(const UnaryCall& call, const v1::EvaluateModelRequest& request,
                        v1::EvaluateModelResponse* response) const;

  const CallRunner& runner_;
  ModelLoader& models_;
};

}  // namespace pepeseg
