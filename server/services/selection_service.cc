#include "server/services/selection_service.h"

namespace pepeseg {

grpc::ServerUnaryReactor* SelectionServiceRpc::CreateSelection(
    grpc::CallbackServerContext* call, const v1::CreateSelectionRequest* request,
    v1::Selection* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return answers_.Create(unary, *request, response);
                     });
}

grpc::ServerUnaryReactor* SelectionServiceRpc::CombineSelections(
    grpc::CallbackServerContext* call, const v1::CombineSelectionsRequest* request,
    v1::Selection* response) {
  return runner_.Run(
      runner_.pools().query, {call, request},
      [this, request, response](const UnaryCall&) { return answers_.Combine(*request, response); });
}

grpc::ServerUnaryReactor* SelectionServiceRpc::UndoSelection(
    grpc::CallbackServerContext* call, const v1::UndoSelectionRequest* request,
    v1::Selection* response) {
  return runner_.Run(
      runner_.pools().io, {call, request},
      [this, request, response](const UnaryCall&) { return answers_.Undo(*request, response); });
}

grpc::ServerUnaryReactor* SelectionServiceRpc::GetSelection(grpc::CallbackServerContext* call,
                                                            const v1::GetSelectionRequest* request,
                                                            v1::Selection* response) {
  return runner_.Run(
      runner_.pools().io, {call, request},
      [this, request, response](const UnaryCall&) { return answers_.Get(*request, response); });
}

grpc::ServerUnaryReactor* SelectionServiceRpc::ListSelections(
    grpc::CallbackServerContext* call, const v1::ListSelectionsRequest* request,
    v1::ListSelectionsResponse* response) {
  return runner_.Run(
      runner_.pools().io, {call, request},
      [this, request, response](const UnaryCall&) { return answers_.List(*request, response); });
}

grpc::ServerUnaryReactor* SelectionServiceRpc::DeleteSelection(
    grpc::CallbackServerContext* call, const v1::DeleteSelectionRequest* request,
    google::protobuf::Empty*) {
  return runner_.Run(runner_.pools().io, {call, request},
                     [this, request](const UnaryCall&) { return answers_.Delete(*request); });
}

}  // namespace pepeseg
