#include "core/model_files/checkpoint.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/byte_reader.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kMagic = "PEPECKPT";
constexpr uint32_t kFormat = 1;
// The file: magic, format, length of the header, header (JSON), sections, SHA-256 in hexadecimal of
// all before it.
constexpr size_t kPrefixBytes = kMagic.size() + 2 * sizeof(uint32_t);
constexpr size_t kDigestBytes = 64;
constexpr uint32_t kMaxHeaderBytes = 1 << 20;  // names and sizes of a few dozen sections

// Returns the bytes of a number as they are in memory, little-endian.
std::string_view BytesOf(const uint32_t& value) {
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}

ByteReader ReaderOf(std::string_view bytes) {
  return ByteReader(absl::string_view(bytes.data(), bytes.size()));
}

absl::Status Damaged(const std::filesystem::path& path, absl::string_view why) {
  return absl::DataLossError(absl::StrCat(path.string(), ": ", why));
}

// Appends bytes to the file and to its digest.
absl::Status Append(AtomicFile& file, Sha256& digest, std::string_view bytes) {
  digest.Add(bytes);
  return file.Append(bytes);
}

// Formats the header: what the checkpoint belongs to, and name, version and size of each section.
std::string FormatHeader(const CheckpointHeader& header,
                         std::span<const CheckpointSection> sections) {
  json list = json::array();
  for (const CheckpointSection& section : sections) {
    list.push_back({{"name", section.name},
                    {"version", section.version},
                    {"size", static_cast<uint64_t>(section.bytes.size())}});
  }
  return json{{"stage", header.stage},
              {"identity", header.identity},
              {"step", header.step},
              {"sections", std::move(list)}}
      .dump();
}

// Parses the header and finds the sections in `body`, the bytes after it. nlohmann checks the types
// of the fields by exceptions, which end here.
absl::Status ParseHeader(std::string_view text, std::string_view body, Checkpoint& checkpoint) {
  const json document = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!document.is_object()) return absl::DataLossError("its header is not a JSON object");
  ByteReader reader = ReaderOf(body);
  try {
    checkpoint.header.stage = document.at("stage").get<std::string>();
    checkpoint.header.identity = document.at("identity").get<std::string>();
    checkpoint.header.step = document.at("step").get<int64_t>();
    for (const json& entry : document.at("sections")) {
      const size_t first = reader.offset();
      const auto size = entry.at("size").get<uint64_t>();
      // Sections lie one after the other in the order of the header; the reader only finds their
      // ends.
      if (!reader.Skip(size)) return absl::DataLossError("its sections are longer than the file");
      checkpoint.sections.push_back({entry.at("name").get<std::string>(),
                                     entry.at("version").get<int>(), body.substr(first, size)});
    }
  } catch (const json::exception& error) {
    return absl::DataLossError(absl::StrCat("its header: ", error.what()));
  }
  if (reader.remaining() == 0) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("has ", reader.remaining(), " bytes after its last section"));
}

// Reads the file. Not by ReadFile, whose std::string may keep short texts in the object itself:
// then moving a Checkpoint would move the bytes that its sections point to.
absl::StatusOr<std::vector<char>> ReadBytes(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const int64_t size, FileSize(path, path.string()));
  std::vector<char> bytes(static_cast<size_t>(size));
  std::ifstream file(path, std::ios::binary);
  if (!file.read(bytes.data(), static_cast<std::streamsize>(size))) {
    return Damaged(path, "cannot be read to its end");
  }
  return bytes;
}

// Checks magic number and digest. Nothing else in the file may be used before.
absl::Status CheckWhole(std::string_view bytes) {
  // Also keeps the substr calls in Parse within the file.
  if (bytes.size() < kPrefixBytes + kDigestBytes) {
    return absl::DataLossError(absl::StrCat("has ", bytes.size(), " bytes: truncated"));
  }
  if (!bytes.starts_with(kMagic)) return absl::DataLossError("is not a checkpoint");
  const std::string_view digest = bytes.substr(bytes.size() - kDigestBytes);
  if (Sha256Hex(bytes.substr(0, bytes.size() - kDigestBytes)) == digest) return absl::OkStatus();
  return absl::DataLossError("its checksum is wrong: truncated or damaged");
}

// Parses checkpoint.storage and sets header and sections, which point into it.
absl::Status Parse(Checkpoint& checkpoint) {
  const std::string_view bytes(checkpoint.storage.data(), checkpoint.storage.size());
  RETURN_IF_ERROR(CheckWhole(bytes));
  ByteReader prefix = ReaderOf(bytes.substr(kMagic.size()));
  const auto format = prefix.Take<uint32_t>();
  const auto header_bytes = prefix.Take<uint32_t>();
  if (format != kFormat) {
    return absl::DataLossError(absl::StrCat("has format ", format, ", not ", kFormat));
  }
  const std::string_view rest =
      bytes.substr(kPrefixBytes, bytes.size() - kPrefixBytes - kDigestBytes);
  if (header_bytes > kMaxHeaderBytes || header_bytes > rest.size()) {
    return absl::DataLossError(absl::StrCat("its header of ", header_bytes, " bytes is too long"));
  }
  return ParseHeader(rest.substr(0, header_bytes), rest.substr(header_bytes), checkpoint);
}

}  // namespace

absl::Status WriteCheckpoint(const std::filesystem::path& path, const CheckpointHeader& header,
                             std::span<const CheckpointSection> sections) {
  // The digest is computed while writing, so that the sections, which may be gigabytes, are read
  // once and never copied.
  const std::string text = FormatHeader(header, sections);
  ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  Sha256 digest;
  RETURN_IF_ERROR(Append(file, digest, kMagic));
  RETURN_IF_ERROR(Append(file, digest, BytesOf(kFormat)));
  RETURN_IF_ERROR(Append(file, digest, BytesOf(static_cast<uint32_t>(text.size()))));
  RETURN_IF_ERROR(Append(file, digest, text));
  for (const CheckpointSection& section : sections) {
    RETURN_IF_ERROR(Append(file, digest, section.bytes));
  }
  RETURN_IF_ERROR(file.Append(digest.Hex()));
  return file.Commit();
}

absl::StatusOr<Checkpoint> ReadCheckpoint(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(std::vector<char> bytes, ReadBytes(path));
  return ParseCheckpoint(std::move(bytes), path);
}

absl::StatusOr<Checkpoint> ParseCheckpoint(std::vector<char> bytes,
                                           const std::filesystem::path& name) {
  Checkpoint checkpoint;
  checkpoint.storage = std::move(bytes);
  const absl::Status parsed = Parse(checkpoint);
  if (!parsed.ok()) return Damaged(name, parsed.message());
  return checkpoint;
}

absl::Status CheckSize(const char* name, size_t size, int64_t expected) {
  if (static_cast<int64_t>(size) == expected) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(name, " has ", size, " values, must have ", expected));
}

absl::Status CheckFinite(const char* name, std::span<const float> values) {
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad == values.end()) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(name, "[", bad - values.begin(), "] is ", *bad, ": not finite"));
}

}  // namespace pepeseg
