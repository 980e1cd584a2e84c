// The part of the service that is about what it keeps: labels and selections.
#include "server/rpc/unary.h"
#include "server/services/label_answer.h"
#include "server/services/segmentation_service.h"
#include "server/services/selection_answer.h"

namespace pepeseg {

grpc::ServerUnaryReactor* SegmentationServiceRpc::CreateLabel(grpc::CallbackServerContext* call,
                                                              const v1::CreateLabelRequest* request,
                                                              v1::Label* response) {
  return RunOnQueryPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    return AnswerCreateLabel(context_, *request, response);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ListLabels(grpc::CallbackServerContext* call,
                                                             const v1::ListLabelsRequest* request,
                                                             v1::ListLabelsResponse* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    return AnswerListLabels(context_, *request, response);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::DeleteLabel(grpc::CallbackServerContext* call,
                                                              const v1::DeleteLabelRequest* request,
                                                              google::protobuf::Empty*) {
  return RunOnPool({call, request}, context_, [this, request](const UnaryCall&) {
    return AnswerDeleteLabel(context_, *request);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Select(grpc::CallbackServerContext* call,
                                                         const v1::SelectRequest* request,
                                                         v1::Selection* response) {
  return RunOnQueryPool({call, request}, context_,
                        [this, request, response](const UnaryCall& unary) {
                          return AnswerSelect(unary, context_, *request, response);
                        });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::CombineSelections(
    grpc::CallbackServerContext* call, const v1::CombineSelectionsRequest* request,
    v1::Selection* response) {
  return RunOnQueryPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    return AnswerCombineSelections(context_, *request, response);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::UndoSelection(
    grpc::CallbackServerContext* call, const v1::UndoSelectionRequest* request,
    v1::Selection* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    return AnswerUndoSelection(context_, *request, response);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::GetSelection(
    grpc::CallbackServerContext* call, const v1::GetSelectionRequest* request,
    v1::Selection* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    return AnswerGetSelection(context_, *request, response);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ListSelections(
    grpc::CallbackServerContext* call, const v1::ListSelectionsRequest* request,
    v1::ListSelectionsResponse* response) {
  return RunOnPool({call, request}, context_, [this, request, response](const UnaryCall&) {
    return AnswerListSelections(context_, *request, response);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::DeleteSelection(
    grpc::CallbackServerContext* call, const v1::DeleteSelectionRequest* request,
    google::protobuf::Empty*) {
  return RunOnPool({call, request}, context_, [this, request](const UnaryCall&) {
    return AnswerDeleteSelection(context_, *request);
  });
}

}  // namespace pepeseg
