#include "server/worker_protocol/client_text.h"

#include <algorithm>
#include <vector>

namespace pepeseg {
namespace {

constexpr std::string_view kCut = "...";

bool IsOneOf(char c, std::string_view characters) {
  return characters.find(c) != std::string_view::npos;
}

// Whether an absolute path may start at `at`: at the start, or after a space, a quote, a bracket or
// punctuation, but not with "//" as in "http://".
bool MayBeginPath(std::string_view text, size_t at) {
  if (text[at] != '/' || (at + 1 < text.size() && text[at + 1] == '/')) return false;
  return at == 0 || IsOneOf(text[at - 1], " \t\n\r\"'`([{<=,;:|");
}

// Removes the folders of absolute paths.
std::string WithoutFolders(std::string_view text) {
  std::string shorter;
  for (size_t at = 0; at < text.size();) {
    if (!MayBeginPath(text, at)) {
      shorter.push_back(text[at++]);
      continue;
    }
    const size_t end = std::min(text.find_first_of(" \t\n\r\"'`)]}>,;:|", at), text.size());
    const std::string_view path = text.substr(at, end - at);
    const size_t last = path.find_last_not_of('/');
    const size_t folder = last == std::string_view::npos ? 0 : path.rfind('/', last);
    // "/tmp" and "/2" have no folder to remove.
    shorter.append(folder == 0 ? path : path.substr(folder + 1, last - folder));
    at = end;
  }
  return shorter;
}

// Whether a character is a control character (C0, DEL, C1), a separator of lines or paragraphs, or
// a mark that changes the direction of the text after it (U+200E, U+200F, U+2028 to U+202E, U+2066
// to U+2069).
bool Steers(std::string_view character) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(character[i]); };
  if (character.size() == 1) return byte(0) < 0x20 || byte(0) == 0x7f;
  if (character.size() == 2) return byte(0) == 0xc2 && byte(1) < 0xa0;
  if (character.size() != 3 || byte(0) != 0xe2) return false;
  const bool separates = byte(1) == 0x80 && (byte(2) == 0x8e || byte(2) == 0x8f ||
                                             (byte(2) >= 0xa8 && byte(2) <= 0xae));
  return separates || (byte(1) == 0x81 && byte(2) >= 0xa6 && byte(2) <= 0xa9);
}

}  // namespace

size_t Utf8CharacterLength(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  if (lead < 0x80) return 1;
  const size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((static_cast<unsigned char>(text[i]) & 0xc0) != 0x80) return 0;
  }
  const auto second = static_cast<unsigned char>(text[1]);
  // Overlong forms, surrogates, and code points above U+10FFFF.
  if ((lead == 0xe0 && second < 0xa0) || (lead == 0xed && second > 0x9f) ||
      (lead == 0xf0 && second < 0x90) || (lead == 0xf4 && second > 0x8f)) {
    return 0;
  }
  return length;
}

std::string ClientText(std::string_view text, size_t max_bytes) {
  const std::string shorter = WithoutFolders(text);
  std::string_view left = shorter;
  while (!left.empty() && IsOneOf(left.back(), "\r\n")) left.remove_suffix(1);
  std::string line;
  while (!left.empty()) {
    const size_t length = Utf8CharacterLength(left);
    std::string_view character = length == 0 ? "?" : left.substr(0, length);
    left.remove_prefix(std::max<size_t>(length, 1));
    if (character == "\r" && !left.empty() && left[0] == '\n') continue;
    if (character == "\n" || character == "\r") {
      character = " | ";
    } else if (character == "\t") {
      character = " ";
    } else if (Steers(character)) {
      character = "?";
    }
    if (line.size() + character.size() + kCut.size() > max_bytes) {
      line.append(kCut.substr(0, max_bytes));
      break;
    }
    line.append(character);
  }
  return line;
}

absl::Status ClientStatus(const absl::Status& status) {
  return absl::Status(status.code(), ClientText(std::string(status.message())));
}

void CleanTexts(google::protobuf::Message& message) {
  using google::protobuf::FieldDescriptor;
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const bool is_text = field->type() == FieldDescriptor::TYPE_STRING;
    const bool is_message = field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    if (field->is_map() || (!is_text && !is_message)) continue;
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (is_text && field->is_repeated()) {
        reflection.SetRepeatedString(&message, field, i,
                                     ClientText(reflection.GetRepeatedString(message, field, i)));
      } else if (is_text) {
        reflection.SetString(&message, field, ClientText(reflection.GetString(message, field)));
      } else if (field->is_repeated()) {
        CleanTexts(*reflection.MutableRepeatedMessage(&message, field, i));
      } else {
        CleanTexts(*reflection.MutableMessage(&message, field));
      }
    }
  }
}

}  // namespace pepeseg
