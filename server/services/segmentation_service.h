#pragma once

#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/export_selection.h"
#include "server/services/model_loader.h"
#include "server/services/render_answer.h"
#include "server/services/segment_answer.h"
#include "server/services/selection_answer.h"
#include "server/services/selections.h"

namespace pepeseg {

// Answers queries of models in memory. Each call is answered on a thread of the pool for its kind
// of work: `io` where only the store is read, `evaluation` where computing takes minutes, else
// `query`.
class SegmentationServiceRpc final : public v1::SegmentationService::CallbackService {
 public:
  // Both must outlive it.
  SegmentationServiceRpc(const CallRunner& runner, ModelLoader& models)
      : runner_(runner), models_(models), selections_(models.store(), models.data_folder()) {}

  grpc::ServerUnaryReactor* Segment(grpc::CallbackServerContext* call,
                                    const v1::SegmentRequest* request,
                                    v1::SegmentResponse* response) override;
  grpc::ServerBidiReactor<v1::SegmentStreamRequest, v1::SegmentStreamResponse>* SegmentStream(
      grpc::CallbackServerContext* call) override;
  grpc::ServerUnaryReactor* ProposeScales(grpc::CallbackServerContext* call,
                                          const v1::ProposeScalesRequest* request,
                                          v1::ProposeScalesResponse* response) override;
  grpc::ServerUnaryReactor* Evaluate(grpc::CallbackServerContext* call,
                                     const v1::EvaluateRequest* request,
                                     v1::EvaluateResponse* response) override;
  grpc::ServerUnaryReactor* Decompose(grpc::CallbackServerContext* call,
                                      const v1::DecomposeRequest* request,
                                      v1::DecomposeResponse* response) override;
  grpc::ServerUnaryReactor* CreateLabel(grpc::CallbackServerContext* call,
                                        const v1::CreateLabelRequest* request,
                                        v1::Label* response) override;
  grpc::ServerUnaryReactor* ListLabels(grpc::CallbackServerContext* call,
                                       const v1::ListLabelsRequest* request,
                                       v1::ListLabelsResponse* response) override;
  grpc::ServerUnaryReactor* DeleteLabel(grpc::CallbackServerContext* call,
                                        const v1::DeleteLabelRequest* request,
                                        google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* Select(grpc::CallbackServerContext* call,
                                   const v1::SelectRequest* request,
                                   v1::Selection* response) override;
  grpc::ServerUnaryReactor* CombineSelections(grpc::CallbackServerContext* call,
                                              const v1::CombineSelectionsRequest* request,
                                              v1::Selection* response) override;
  grpc::ServerUnaryReactor* UndoSelection(grpc::CallbackServerContext* call,
                                          const v1::UndoSelectionRequest* request,
                                          v1::Selection* response) override;
  grpc::ServerUnaryReactor* GetSelection(grpc::CallbackServerContext* call,
                                         const v1::GetSelectionRequest* request,
                                         v1::Selection* response) override;
  grpc::ServerUnaryReactor* ListSelections(grpc::CallbackServerContext* call,
                                           const v1::ListSelectionsRequest* request,
                                           v1::ListSelectionsResponse* response) override;
  grpc::ServerUnaryReactor* DeleteSelection(grpc::CallbackServerContext* call,
                                            const v1::DeleteSelectionRequest* request,
                                            google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* Render(grpc::CallbackServerContext* call,
                                   const v1::RenderRequest* request,
                                   v1::RenderResponse* response) override;
  grpc::ServerWriteReactor<v1::ExportSelectionResponse>* ExportSelection(
      grpc::CallbackServerContext* call, const v1::ExportSelectionRequest* request) override;

 private:
  absl::Status AnswerEvaluate(const UnaryCall& call, const v1::EvaluateRequest& request,
                              v1::EvaluateResponse* response) const;
  absl::Status AnswerDecompose(const UnaryCall& call, const v1::DecomposeRequest& request,
                               v1::DecomposeResponse* response) const;

  const CallRunner& runner_;
  ModelLoader& models_;
  Selections selections_;
  const SegmentAnswers segment_answers_{models_};
  const RenderAnswers render_answers_{models_, selections_};
  const SelectionAnswers selection_answers_{models_, selections_};
};

}  // namespace pepeseg
