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

  PEPESEG_UNARY(EvaluateModel, v1::EvaluateModelRequest, v1::EvaluateModelResponse)

 private:
  const CallRunner& runner_;
  ModelLoader& models_;
  const BlobStore& blobs_;
  const PhotographProcess& photographs_;
};

}  // namespace pepeseg
