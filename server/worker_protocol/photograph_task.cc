#include "server/worker_protocol/photograph_task.h"

#include <array>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {

namespace {

using Json = nlohmann::json;

constexpr uint32_t kPhotographMagic = 0x31485050;  // "PPH1"

// The header as it is in the file. Both processes run on one machine, so byte order does not
// matter.
struct PhotographHeaderBytes {
  uint32_t magic = kPhotographMagic;
  int32_t code = 0;
  int32_t width = 0;
  int32_t height = 0;
  int64_t num_bytes = 0;
};
static_assert(sizeof(PhotographHeaderBytes) == kPhotographHeaderBytes);

}  // namespace

std::string FormatPhotographTask(const PhotographTask& task) {
  const Json json = {{"name", task.name},
                     {"sha256", task.sha256},
                     {"view", task.form.view ? FormatView(*task.form.view) : ""},
                     {"upright", task.form.upright},
                     {"max_side", task.form.max_side},
                     {"raw", task.raw}};
  return json.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace);
}

absl::StatusOr<PhotographTask> ParsePhotographTask(absl::string_view text) {
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  try {
    PhotographTask task;
    task.name = json.at("name");
    task.sha256 = json.at("sha256");
    task.raw = json.at("raw");
    task.form.upright = json.at("upright");
    task.form.max_side = json.at("max_side");
    const std::string view = json.at("view");
    if (!view.empty()) {
      ASSIGN_OR_RETURN(ModelView parsed, ParseView(view));
      task.form.view = std::move(parsed);
    }
    return task;
  } catch (const Json::exception& error) {
    return absl::InvalidArgumentError(std::string("not a photograph task: ") + error.what());
  }
}

std::string FormatPhotographHeader(const PhotographHeader& header) {
  const PhotographHeaderBytes bytes{kPhotographMagic, static_cast<int32_t>(header.code),
                                    header.width, header.height, header.num_bytes};
  std::string text(sizeof(bytes), '\0');
  std::memcpy(text.data(), &bytes, sizeof(bytes));
  return text;
}

absl::StatusOr<PhotographHeader> ParsePhotographHeader(absl::string_view bytes,
                                                       int64_t file_bytes) {
  PhotographHeaderBytes read;
  if (bytes.size() < sizeof(read)) return absl::InternalError("the answer is cut short");
  std::memcpy(&read, bytes.data(), sizeof(read));
  const bool known_code =
      read.code >= 0 && read.code <= static_cast<int>(absl::StatusCode::kUnauthenticated);
  const bool is_error = read.code != 0;
  if (read.magic != kPhotographMagic || !known_code ||
      read.num_bytes != file_bytes - kPhotographHeaderBytes ||
      (is_error && read.num_bytes > kMaxPhotographMessageBytes) ||
      (!is_error && (read.width < 1 || read.height < 1 || read.num_bytes < 1))) {
    return absl::InternalError("the answer is malformed");
  }
  return PhotographHeader{static_cast<absl::StatusCode>(read.code), read.width, read.height,
                          read.num_bytes};
}

}  // namespace pepeseg
