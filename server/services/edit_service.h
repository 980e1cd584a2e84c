#pragma once

#include "pepeseg/v1/edit_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/edit_model.h"

namespace pepeseg {

// Edits models, on the pool `correction`.
class EditServiceRpc final : public v1::EditService::CallbackService {
 public:
  // What it depends on must outlive it.
  explicit EditServiceRpc(const EditModelStream::Dependencies& deps) : deps_(deps) {}

  grpc::ServerWriteReactor<v1::EditModelResponse>* EditModel(
      grpc::CallbackServerContext* call, const v1::EditModelRequest* request) override;

 private:
  const EditModelStream::Dependencies deps_;
};

}  // namespace pepeseg
