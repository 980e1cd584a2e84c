#pragma once

#include "pepeseg/v1/render_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/render_answer.h"
#include "server/services/selections.h"

namespace pepeseg {

// Renders models in memory, on the pool `query`, and exports models and meshes of them.
class RenderServiceRpc final : public v1::RenderService::CallbackService {
 public:
  // All must outlive it.
  RenderServiceRpc(const CallRunner& runner, ModelLoader& models, JobSnapshots& snapshots,
                   const Selections& selections);

  PEPESEG_UNARY(RenderView, v1::RenderViewRequest, v1::RenderViewResponse)
  grpc::ServerWriteReactor<v1::ExportGaussiansResponse>* ExportGaussians(
      grpc::CallbackServerContext* call, const v1::ExportGaussiansRequest* request) override;
  grpc::ServerWriteReactor<v1::ExportMeshResponse>* ExportMesh(
      grpc::CallbackServerContext* call, const v1::ExportMeshRequest* request) override;

 private:
  const CallRunner& runner_;
  ModelLoader& models_;
  JobSnapshots& snapshots_;
  const Selections& selections_;
  const RenderAnswers answers_{snapshots_, selections_};
};

}  // namespace pepeseg
