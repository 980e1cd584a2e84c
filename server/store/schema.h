#pragma once

#include <string>
#include <vector>

namespace pepeseg {

// Version of the schema in schema.sql. A database of another version is refused. Release 0.1.0 has
// 14: the next version needs a migration from it. Lower ones were those of development.
inline constexpr int kSchemaVersion = 14;

// The text of schema.sql, which CMake embeds.
extern const char kSchemaText[];

// Returns the statements of kSchemaText in order, without comments and final ';'. A comment is all
// from "--" to the end of its line: no string of the text may contain "--" or ';'.
std::vector<std::string> SchemaStatements();

}  // namespace pepeseg
