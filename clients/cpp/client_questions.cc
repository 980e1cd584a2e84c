// A client's questions to a model, and its export.
#include <string>

#include "absl/strings/str_cat.h"
#include "clients/cpp/ask.h"
#include "clients/cpp/checksums.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

using Segmentation = v1::SegmentationService::Stub;
using Header = v1::ExportSelectionResponse::Header;

constexpr double kEvaluateSeconds = 3600;  // a hundred entities on a CPU take a while

// Checks each chunk and the whole; the header is the stream's first message.
absl::StatusOr<Header> Receive(grpc::ClientReader<v1::ExportSelectionResponse>& stream,
                               OutputFile& file) {
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
    RETURN_IF_ERROR(file.Append(data));
  }
  RETURN_IF_ERROR(FromGrpc(stream.Finish()));
  if (size != header.num_bytes() || sha256.Finish() != header.sha256()) {
    return absl::DataLossError(absl::StrCat("the PLY is not what was announced: ", size, " of ",
                                            header.num_bytes(), " bytes"));
  }
  return header;
}

// All of an export. One that the server puts off has sent nothing yet.
absl::StatusOr<Header> ReceiveAll(Segmentation& segmentation,
                                  const v1::ExportSelectionRequest& request, OutputFile& file) {
  const RetryBudget retries(kCallSeconds);
  while (true) {
    Call call(SceneOf(request.model()), 0);
    absl::StatusOr<Header> header = Receive(*segmentation.ExportSelection(call, request), file);
    if (header.ok()) return header;
    call.Cancel();
    if (file.num_bytes() > 0 || !retries.WaitAfter(header.status())) return header.status();
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
  ASSIGN_OR_RETURN(OutputFile output, OutputFile::Create(file));
  ASSIGN_OR_RETURN(const Header header, ReceiveAll(*segmentation_, request, output));
  RETURN_IF_ERROR(output.Commit());
  return header;
}

}  // namespace pepeseg::client
