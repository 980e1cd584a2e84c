#pragma once

#include "pepeseg/v1/label_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

// Answers calls about labels: on the pool `io` where only the store is read, on `query` where a
// model may have to be loaded, on `evaluation` where it segments all of them.
class LabelServiceRpc final : public v1::LabelService::CallbackService {
 public:
  // All must outlive it.
  LabelServiceRpc(const CallRunner& runner, ModelLoader& models, JobSnapshots& snapshots,
                  ViewImages& images);

  PEPESEG_UNARY(CreateLabel, v1::CreateLabelRequest, v1::Label)
  PEPESEG_UNARY(GetLabel, v1::GetLabelRequest, v1::Label)
  PEPESEG_UNARY(ListLabels, v1::ListLabelsRequest, v1::ListLabelsResponse)
  PEPESEG_UNARY(DeleteLabel, v1::DeleteLabelRequest, google::protobuf::Empty)
  grpc::ServerWriteReactor<v1::ExportAnnotationsResponse>* ExportAnnotations(
      grpc::CallbackServerContext* call, const v1::ExportAnnotationsRequest* request) override;

 private:
  const CallRunner& runner_;
  ModelLoader& models_;
  JobSnapshots& snapshots_;
  ViewImages& images_;
};

}  // namespace pepeseg
