#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"

namespace pepeseg {

// A scene from its creation to a deleted label, as a client does it that may lose its server at any
// call: every create has a request_id, and after a loss all is asked for again from the start. What
// was answered once must be answered alike for ever: anything else is an error of code DATA_LOSS.
// The server's worker is tests/server/model_worker.cc.
class LifeOfAScene {
 public:
  // The scene's id; its files are made from it.
  explicit LifeOfAScene(std::string id) : id_(std::move(id)) {}

  // All of it, from the start; what was done before is asked for again. UNAVAILABLE and what else
  // gRPC says of a lost server: go on later.
  absl::Status Run(const std::shared_ptr<grpc::Channel>& channel);
  // Whether what was answered so far is there.
  absl::Status Check(const std::shared_ptr<grpc::Channel>& channel);
  // The scene with all that belongs to it.
  absl::Status Delete(const std::shared_ptr<grpc::Channel>& channel);
  bool done() const { return done_; }
  // The last error was no server's: it is what this client found wrong with an answer.
  bool found_wrong() const { return found_wrong_; }
  // A training may end as FAILED: its error is Run's, and the next Run trains anew.
  void LetTrainingFail() { may_fail_ = true; }

  const std::string& scene() const { return scene_; }
  const std::string& dataset() const { return dataset_; }
  const std::string& job() const { return job_; }
  const std::string& model() const { return model_; }
  const std::string& selection() const { return selection_; }

 private:
  struct Stubs;
  absl::Status Wrong(const std::string& what);
  absl::Status Remember(std::string& known, const std::string& answer, const char* what);
  absl::Status Upload(Stubs& stubs);
  absl::Status WriteMissing(Stubs& stubs, const v1::Upload& upload);
  absl::Status Train(Stubs& stubs);
  absl::Status Ask(Stubs& stubs);
  absl::Status Keep(Stubs& stubs);

  const std::string id_;
  std::string scene_, upload_, dataset_, job_, model_, mask_, label_, selection_, second_;
  bool label_deleted_ = false;
  bool may_fail_ = false;
  int num_failed_ = 0;  // trainings
  bool found_wrong_ = false;
  bool done_ = false;
};

}  // namespace pepeseg
