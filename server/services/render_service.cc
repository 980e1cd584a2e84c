#include "server/services/render_service.h"

#include <memory>

namespace pepeseg {

grpc::ServerUnaryReactor* RenderServiceRpc::RenderView(grpc::CallbackServerContext* call,
                                                       const v1::RenderViewRequest* request,
                                                       v1::RenderViewResponse* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return answers_.Render(unary, *request, response);
                     });
}

grpc::ServerWriteReactor<v1::ExportGaussiansResponse>* RenderServiceRpc::ExportGaussians(
    grpc::CallbackServerContext* call, const v1::ExportGaussiansRequest* request) {
  const auto stream = std::make_shared<ExportGaussiansStream>(
      ExportGaussiansStream::Parts{runner_, models_, selections_}, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
