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
#include "server/jobs/photograph_process.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// What decodes photographs: a pool whose threads wait for processes, one each, and how those are
// run. `checker` sets stored files aside that are found damaged.
struct PhotographDecoders {
  WorkerPool* pool;
  const PhotographProcess* process;
  BlobChecker* checker;
};

// A GetPhotograph call: a blob as it is, or a picture that a process of its own makes of it, a
// chunk at a time. The pool for what waits on the disk sends; the decoders' own waits for the
// processes. A stored file that fails is read again and set aside if it is damaged, before the call
// ends with DATA_LOSS: an upload that follows asks for it.
class GetPhotographStream final : public WriteStream<v1::GetPhotographResponse> {
 public:
  GetPhotographStream(const ServiceContext& context, const PhotographDecoders& decoders,
                      grpc::CallbackServerContext* call, const v1::GetPhotographRequest& request)
      : WriteStream(context.streams, context.pool),
        context_(context),
        decoders_(decoders),
        call_(call),
        origin_(OriginOf(*call)),
        request_(request) {}

 private:
  enum class Phase { kNew, kMaking, kSending, kChecking };

  Step Work(bool io_ok) override;
  // A reader that takes nothing for so long loses the stream, and with it the file on the disk.
  absl::Duration io_limit() const override { return context_.streams->limits().stuck_export; }
  void CancelCall() override { call_->TryCancel(); }
  absl::Status Open();
  absl::Status OpenOriginal(const DatasetFileRow& file, const std::filesystem::path& blob);
  absl::Status StartMaking(const PhotographTask& task, const std::filesystem::path& blob);
  // False: the picture is not there yet.
  absl::StatusOr<bool> TakePicture();
  absl::Status FillChunk();
  Step Fail(absl::Status status);

  const ServiceContext context_;
  const PhotographDecoders decoders_;
  grpc::CallbackServerContext* const call_;
  const CallOrigin origin_;
  v1::GetPhotographRequest request_;  // with keys, once it is authorised
  Phase phase_ = Phase::kNew;
  std::mutex made_mutex_;
  std::optional<absl::StatusOr<PhotographPicture>> made_;  // guarded by made_mutex_
  std::optional<OpenFile> file_;                           // what is sent
  int64_t offset_ = 0;                                     // of the next byte to send
  int64_t num_bytes_left_ = 0;
  std::string project_;
  DatasetFileRow row_;  // of the photograph; its path is empty until it is found
  std::string sha256_;  // of an original
  Sha256 digest_;
  absl::Status failure_;           // of the call, while its file is checked
  std::shared_future<int> check_;  // number of damaged files
};

}  // namespace pepeseg
