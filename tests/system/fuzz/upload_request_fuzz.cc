#include "core/base/file_name.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"
#include "server/services/upload_rules.h"
#include "tests/system/fuzz/fuzz_message.h"

PEPESEG_FUZZ_MESSAGE(upload_request, pepeseg::v1::CreateUploadRequest) {
  (void)pepeseg::SplitSceneName(message.parent());
  (void)pepeseg::CheckRequestId(message.request_id());
  const auto files = pepeseg::CheckUploadFiles(message);
  if (!files.ok()) return;
  pepeseg::fuzz::Expect(!files->empty(), "a file");
  for (const pepeseg::DatasetFileRecord& file : *files) {
    pepeseg::fuzz::Expect(pepeseg::ValidateName(file.path).ok(), "a name for the worker");
    pepeseg::fuzz::Expect(file.size > 0 && file.sha256.size() == 64, "a size and a digest");
  }
}
