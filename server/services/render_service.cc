#include "server/services/render_service.h"

#include <memory>

#include "server/services/export_gaussians.h"
#include "server/services/export_mesh.h"

namespace pepeseg {

RenderServiceRpc::RenderServiceRpc(const CallRunner& runner, ModelLoader& models,
                                   JobSnapshots& snapshots, const Selections& selections)
    : runner_(runner), models_(models), snapshots_(snapshots), selections_(selections) {}

absl::Status RenderServiceRpc::RenderView(const UnaryCall& call,
                                          const v1::RenderViewRequest& request,
                                          v1::RenderViewResponse* response) const {
  return answers_.Render(call, request, response);
}

grpc::ServerWriteReactor<v1::ExportGaussiansResponse>* RenderServiceRpc::ExportGaussians(
    grpc::CallbackServerContext* call, const v1::ExportGaussiansRequest* request) {
  const auto stream = std::make_shared<ExportGaussiansStream>(
      ExportGaussiansStream::Dependencies{runner_, models_, selections_}, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

grpc::ServerWriteReactor<v1::ExportMeshResponse>* RenderServiceRpc::ExportMesh(
    grpc::CallbackServerContext* call, const v1::ExportMeshRequest* request) {
  const auto stream = std::make_shared<ExportMeshStream>(
      ExportMeshStream::Dependencies{runner_, models_, selections_}, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
