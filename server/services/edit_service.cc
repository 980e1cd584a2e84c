#include "server/services/edit_service.h"

#include <memory>

namespace pepeseg {

grpc::ServerWriteReactor<v1::EditModelResponse>* EditServiceRpc::EditModel(
    grpc::CallbackServerContext* call, const v1::EditModelRequest* request) {
  const auto stream = std::make_shared<EditModelStream>(deps_, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
