#include "server/services/label_service.h"

#include "server/services/label_answer.h"

namespace pepeseg {

grpc::ServerUnaryReactor* LabelServiceRpc::CreateLabel(grpc::CallbackServerContext* call,
                                                       const v1::CreateLabelRequest* request,
                                                       v1::Label* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return AnswerCreateLabel(models_, *request, response);
                     });
}

grpc::ServerUnaryReactor* LabelServiceRpc::GetLabel(grpc::CallbackServerContext* call,
                                                    const v1::GetLabelRequest* request,
                                                    v1::Label* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return AnswerGetLabel(models_, *request, response);
                     });
}

grpc::ServerUnaryReactor* LabelServiceRpc::ListLabels(grpc::CallbackServerContext* call,
                                                      const v1::ListLabelsRequest* request,
                                                      v1::ListLabelsResponse* response) {
  return runner_.Run(runner_.pools().io, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return AnswerListLabels(models_.store(), *request, response);
                     });
}

grpc::ServerUnaryReactor* LabelServiceRpc::DeleteLabel(grpc::CallbackServerContext* call,
                                                       const v1::DeleteLabelRequest* request,
                                                       google::protobuf::Empty*) {
  return runner_.Run(runner_.pools().io, {call, request}, [this, request](const UnaryCall&) {
    return AnswerDeleteLabel(models_.store(), *request);
  });
}

}  // namespace pepeseg
