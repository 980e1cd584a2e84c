#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/label_service.pb.h"
#include "server/services/model_loader.h"
#include "server/store/store.h"

// Answers LabelService's calls. All of them block on the store.
namespace pepeseg {

// Also loads the live model if it is not in memory, so it belongs on the query pool.
absl::Status AnswerCreateLabel(ModelLoader& models, const v1::CreateLabelRequest& request,
                               v1::Label* response);
// Returns the mask as the view of the live model shows it, in the frame of the request. Loads the
// model, too.
absl::Status AnswerGetLabel(ModelLoader& models, const v1::GetLabelRequest& request,
                            v1::Label* response);
absl::Status AnswerListLabels(Store& store, const v1::ListLabelsRequest& request,
                              v1::ListLabelsResponse* response);
absl::Status AnswerDeleteLabel(Store& store, const v1::DeleteLabelRequest& request);

}  // namespace pepeseg
