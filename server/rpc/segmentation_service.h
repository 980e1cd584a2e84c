#pragma once

#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

class SegmentationServiceRpc final : public v1::SegmentationService::CallbackService {
 public:
  explicit SegmentationServiceRpc(const ServiceContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* Segment(grpc::CallbackServerContext* call,
                                    const v1::SegmentRequest* request,
                                    v1::SegmentResponse* response) override;
  grpc::ServerUnaryReactor* ProposeScales(grpc::CallbackServerContext* call,
                                          const v1::ProposeScalesRequest* request,
                                          v1::ProposeScalesResponse* response) override;
  grpc::ServerUnaryReactor* Evaluate(grpc::CallbackServerContext* call,
                                     const v1::EvaluateRequest* request,
                                     v1::EvaluateResponse* response) override;
  grpc::ServerUnaryReactor* Decompose(grpc::CallbackServerContext* call,
                                      const v1::DecomposeRequest* request,
                                      v1::DecomposeResponse* response) override;
  grpc::ServerUnaryReactor* Render(grpc::CallbackServerContext* call,
                                   const v1::RenderRequest* request,
                                   v1::RenderResponse* response) override;
  grpc::ServerWriteReactor<v1::ExportSelectionResponse>* ExportSelection(
      grpc::CallbackServerContext* call, const v1::ExportSelectionRequest* request) override;

 private:
  const ServiceContext context_;
};

}  // namespace pepeseg
