#pragma once

#include "pepeseg/v1/label_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Answers calls about labels: on the pool `io` where only the store is read, on `query` where a
// model may have to be loaded.
class LabelServiceRpc final : public v1::LabelService::CallbackService {
 public:
  // Both must outlive it.
  LabelServiceRpc(const CallRunner& runner, ModelLoader& models);

  grpc::ServerUnaryReactor* CreateLabel(grpc::CallbackServerContext* call,
                                        const v1::CreateLabelRequest* request,
                                        v1::Label* response) override;
  grpc::ServerUnaryReactor* GetLabel(grpc::CallbackServerContext* call,
                                     const v1::GetLabelRequest* request,
                                     v1::Label* response) override;
  grpc::ServerUnaryReactor* ListLabels(grpc::CallbackServerContext* call,
                                       const v1::ListLabelsRequest* request,
                                       v1::ListLabelsResponse* response) override;
  grpc::ServerUnaryReactor* DeleteLabel(grpc::CallbackServerContext* call,
                                        const v1::DeleteLabelRequest* request,
                                        google::protobuf::Empty* response) override;

 private:
  const CallRunner& runner_;
  ModelLoader& models_;
};

}  // namespace pepeseg
