#include <cstring>
#include <fstream>
#include <string>

#include "core/base/digest.h"
#include "server/worker_protocol/event_log.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/testing/temp_folder.h"

namespace {

std::string Record(const std::string& payload) {
  const auto length = static_cast<uint32_t>(payload.size());
  const uint32_t crc = pepeseg::Crc32c(payload);
  std::string record(8, '\0');
  std::memcpy(record.data(), &length, 4);
  std::memcpy(record.data() + 4, &crc, 4);
  return record + payload;
}

}  // namespace

// Reads the bytes as the log of the first attempt, and as one record with the right checksum. Then
// a worker continues the log.
PEPESEG_FUZZ_TARGET(event_log) {
  static const pepeseg::testing::TempFolder folder;
  const std::string text(bytes);
  for (const std::string& log : {text, Record(text)}) {
    std::ofstream(folder / "events.log", std::ios::binary) << log;
    std::ofstream(folder / "events-1.log", std::ios::binary) << log;
    pepeseg::EventLogReader reader(folder / "events.log");
    (void)reader.Read(10);
    auto writer = pepeseg::EventLogWriter::Open(folder / "events.log", 1);
    pepeseg::fuzz::Expect(writer.ok(), "a log to go on in");
    pepeseg::v1::JobEvent event;
    event.mutable_warning()->set_message("x");
    pepeseg::fuzz::Expect((*writer)->Append(event).ok(), "an event to be appended");
    pepeseg::EventLogReader again(folder / "events.log", (*writer)->last_sequence() - 1);
    const auto events = again.Read(1 << 20);
    pepeseg::fuzz::Expect(
        events.ok() && !events->empty() && events->back().sequence() == (*writer)->last_sequence(),
        "the event to be found");
  }
}
