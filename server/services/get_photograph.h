#pragma once

#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "core/base/digest.h"
#include "grpcpp/server_context.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "server/data/blob_checker.h"
#include "server/data/blob_store.h"
#include "server/jobs/photograph_process.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// The pool and the program that decode photographs.
struct PhotographDecoders {
  WorkerPool* pool;                  // each thread waits for one process
  const PhotographProcess* process;  // how a process is started
  BlobChecker* checker;              // sets stored files aside that are damaged
};

// A GetPhotograph call. Sends a stored file as it is, or a picture that a decoder process makes of
// it, in chunks. The `io` pool sends; the decoders' pool waits for the process. If the process
// fails, or the file does not have its digest, the stored file is read again and, if it is damaged,
// set aside, before the call ends with DATA_LOSS: then the next upload asks for it again.
class GetPhotographStream final : public WriteStream<v1::GetPhotographResponse> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    const ModelLoader& models;
    const BlobStore& blobs;
    PhotographDecoders decoders;
  };
  GetPhotographStream(const Dependencies& deps, grpc::CallbackServerContext* call,
                      const v1::GetPhotographRequest& request)
      : WriteStream(&deps.runner.streams(), &deps.runner.pools().io),
        deps_(deps),
        call_(call),
        origin_(OriginOf(*call)),
        request_(request) {}

 private:
  enum class Phase { kNew, kMaking, kSending, kChecking };

  Step Work(bool io_ok) override;
  // A reader that takes nothing for this time loses the stream, which frees the file on the disk.
  absl::Duration io_limit() const override { return deps_.runner.streams().limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  absl::Status OpenOriginal(const DatasetFileRecord& file, const std::filesystem::path& blob);
  absl::Status StartMaking(const PhotographTask& task, const std::filesystem::path& blob);
  // Returns false while the picture is not there yet.
  absl::StatusOr<bool> TakePicture();
  absl::Status FillChunk();
  // Ends the call with `status`, after the stored file was checked if it may be damaged.
  Step Fail(absl::Status status);

  const Dependencies deps_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  v1::GetPhotographRequest request_;
  Phase phase_ = Phase::kNew;
  std::mutex made_mutex_;
  std::optional<absl::StatusOr<PhotographPicture>> made_;  // guarded by made_mutex_
  std::optional<OpenFile> file_;                           // the file that is being sent
  int64_t offset_ = 0;                                     // the next byte to send
  int64_t num_bytes_left_ = 0;
  std::string project_;
  DatasetFileRecord row_;  // the photograph's record; the path is empty until it is found
  std::string sha256_;     // the digest of an original; empty for a picture
  Sha256 digest_;
  absl::Status failure_;           // the error of the call, while its file is checked
  std::shared_future<int> check_;  // number of damaged files
};

}  // namespace pepeseg
