// A client's questions to a model, and its export.
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "clients/cpp/ask.h"
#include "clients/cpp/checksums.h"
#include "clients/cpp/client.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

using Segmentation = v1::SegmentationService::Stub;
using Header = v1::ExportSelectionResponse::Header;

constexpr double kEvaluateSeconds = 3600;  // a hundred entities on a CPU take a while

// Checks each chunk and the whole; the header is the stream's first message.
absl::StatusOr<Header> Receive(grpc::ClientReader<v1::ExportSelectionResponse>& stream,
                               std::ofstream& file) {
  Header header;
  Sha256 sha256;
  int64_t size = 0;
  v1::ExportSelectionResponse part;
  while (stream.Read(&part)) {
    if (part.has_header()) header = part.header();
    if (!part.has_chunk()) continue;
    const std::string& data = part.chunk().data();
    if (Crc32c(data) != part.chunk().crc32c()) {
      return absl::DataLossError(absl::StrCat("bytes ", size, " to ", size + data.size(),
                                              " of the PLY fail their checksum"));
    }
    sha256.Add(data);
    size += static_cast<int64_t>(data.size());
    file.write(data.data(), static_cast<std::streamsize>(data.size()));
  }
  RETURN_IF_ERROR(FromGrpc(stream.Finish()));
  file.close();
  if (!file) return absl::PermissionDeniedError("cannot write the PLY: is the disk full?");
  if (size != header.num_bytes() || sha256.Finish() != header.sha256()) {
    return absl::DataLossError(absl::StrCat("the PLY is not what was announced: ", size, " of ",
                                            header.num_bytes(), " bytes"));
  }
  return header;
}

// All of an export. One that the server puts off has sent nothing yet.
absl::StatusOr<Header> ReceiveAll(Segmentation& segmentation,
                                  const v1::ExportSelectionRequest& request, std::ofstream& file) {
  const RetryBudget retries(kCallSeconds);
  while (true) {
    Call call(SceneOf(request.model()), 0);
    absl::StatusOr<Header> header = Receive(*segmentation.ExportSelection(call, request), file);
    if (header.ok()) return header;
    call.Cancel();
    if (file.tellp() > 0 || !retries.WaitAfter(header.status())) return header.status();
  }
}

}  // namespace

absl::StatusOr<v1::SegmentResponse> Client::Segment(const v1::SegmentRequest& request) const {
  return Ask(*segmentation_, &Segmentation::Segment, SceneOf(request.model()), request);
}

absl::StatusOr<v1::ProposeScalesResponse> Client::ProposeScales(
    const v1::ProposeScalesRequest& request) const {
  return Ask(*segmentation_, &Segmentation::ProposeScales, SceneOf(request.model()), request);
}

absl::StatusOr<v1::DecomposeResponse> Client::Decompose(const v1::DecomposeRequest& request) const {
  return Ask(*segmentation_, &Segmentation::Decompose, SceneOf(request.model()), request);
}

absl::StatusOr<v1::EvaluateResponse> Client::Evaluate(const v1::EvaluateRequest& request) const {
  return Ask(*segmentation_, &Segmentation::Evaluate, SceneOf(request.model()), request,
             kEvaluateSeconds);
}

absl::StatusOr<v1::RenderResponse> Client::Render(const v1::RenderRequest& request) const {
  return Ask(*segmentation_, &Segmentation::Render, SceneOf(request.model()), request);
}

absl::StatusOr<Header> Client::Export(const v1::ExportSelectionRequest& request,
                                      const std::string& file) const {
  namespace fs = std::filesystem;
  const fs::path beside = file + ".part";
  std::ofstream part(beside, std::ios::binary | std::ios::trunc);
  if (!part) return absl::PermissionDeniedError(absl::StrCat("cannot write ", beside.string()));
  const absl::StatusOr<Header> header = ReceiveAll(*segmentation_, request, part);
  std::error_code error;
  if (!header.ok()) {
    fs::remove(beside, error);
    return header.status();
  }
  fs::rename(beside, file, error);
  if (error) {
    return absl::PermissionDeniedError(absl::StrCat("cannot write ", file, ": ", error.message()));
  }
  return header;
}

}  // namespace pepeseg::client
