/* The statements of OBJ text, and the rows of numbers that they hold.

   The text is walked once to find the lines of each kind. Then the lines of one kind are read side by
   side, because each of them is now known to be the n-th of its kind.

   Called from texbake/mesh/files/obj.py. */

#include "core.h"
#include "decimals.h"

/* Kinds of statements, each with its own list of lines, numbered as in obj.py; a mark is g, o, s or
   usemtl. */
enum { NO_KIND = -1, V, VT, VN, F, MARK };

/* Written in the place of a position index. */
enum { BAD_CORNER = -1, OUT_OF_RANGE = -2 };

struct text {
    const uint8_t *bytes;
    int64_t n;
};

/* Place behind one end of line, where there is one. */
static inline int64_t skip_line_end(struct text text, int64_t at)
{
    if (at < text.n && text.bytes[at] == '\r') {
        at++;
        if (at >= text.n || text.bytes[at] != '\n')
            return at;
    }
    return at + (at < text.n && text.bytes[at] == '\n');
}

static inline bool is_line_end(uint8_t byte)
{
    return byte == '\n' || byte == '\r';
}

/* Place of the next word of a statement, or of its end; a backslash continues the line. */
static inline int64_t skip_blanks(struct text text, int64_t at)
{
    while (at < text.n) {
        const uint8_t byte = text.bytes[at];
        if (byte == '\\')
            at = skip_line_end(text, at + 1);
        else if (byte <= 32 && !is_line_end(byte))
            at++;
        else
            break;
    }
    return at;
}

/* Place behind a word. */
static inline int64_t skip_word(struct text text, int64_t at)
{
    while (at < text.n && is_in_word(text.bytes[at]))
        at++;
    return at;
}

/* Whether a statement has no more words: at the end of the line, or before a comment. */
static inline bool has_ended(struct text text, int64_t at)
{
    return at >= text.n || is_line_end(text.bytes[at]) || text.bytes[at] == '#';
}

/* Kind of the statement at a place, and where it stands: behind its keyword, or at a mark's. */
static inline int kind_of(struct text text, int64_t at, int64_t *behind)
{
    const uint8_t first = text.bytes[at];
    const uint8_t second = at + 1 < text.n ? text.bytes[at + 1] : '\n';
    const uint8_t third = at + 2 < text.n ? text.bytes[at + 2] : '\n';
    *behind = at;
    if (second <= 32) {
        if (first == 'v' || first == 'f')
            *behind = at + 1;
        const bool is_mark = first == 'g' || first == 'o' || first == 's';
        return first == 'v' ? V : first == 'f' ? F : is_mark ? MARK : NO_KIND;
    }
    if (first == 'v' && third <= 32 && (second == 't' || second == 'n')) {
        *behind = at + 2;
        return second == 't' ? VT : VN;
    }
    /* usemtl, or the rare usemap */
    return first == 'u' && second == 's' && third == 'e' ? MARK : NO_KIND;
}

/* Advance `nexts` of each statement's kind, and with `fill` record where it stands. */
EXPORT void find_statements(
    int64_t n, int64_t n_offsets, const uint8_t bytes[n], bool fill, int64_t nexts[5],
    int64_t offsets[n_offsets])
{
    const struct text text = {bytes, n};
    int64_t at = n > 2 && bytes[0] == 0xEF && bytes[1] == 0xBB && bytes[2] == 0xBF ? 3 : 0;
    for (at = skip_blanks(text, at); at < n; at = skip_blanks(text, at)) {
        int64_t behind;
        int kind = kind_of(text, at, &behind);
        if (kind >= 0) {
            if (fill)
                offsets[nexts[kind]] = behind;
            nexts[kind]++;
        }
        at = behind;
        while (at < n && !is_line_end(bytes[at])) {
            /* Numbers go on behind a backslash at the end of a line; a name or a comment ends. */
            if (bytes[at] == '#')
                kind = NO_KIND;
            at++;
            if (kind >= 0 && kind != MARK && bytes[at - 1] == '\\')
                at = skip_line_end(text, at);
        }
        at++;
    }
}

/* Read the numbers of lines start to stop - 1; those that `values` has no column for are only
   counted. */
EXPORT void read_rows(
    int64_t n, int64_t n_rows, int64_t n_columns, const uint8_t bytes[n],
    const int64_t starts[n_rows], int64_t start, int64_t stop, const uint64_t fives[256][2],
    double values[n_rows][n_columns], int32_t n_words[n_rows])
{
    const struct text text = {bytes, n};
    for (int64_t row = start; row < stop; row++) {
        int32_t n_read = 0;
        for (int64_t at = skip_blanks(text, starts[row]); !has_ended(text, at);
             at = skip_blanks(text, at)) {
            if (n_read < n_columns)
                values[row][n_read] = read_decimal(bytes, n, fives, &at);
            else
                at = skip_word(text, at);
            n_read++;
        }
        n_words[row] = n_read;
    }
}

/* Offsets of the v, vt and vn lines: an index that counts backwards depends on them. */
struct lines {
    int64_t n;
    const int64_t *offsets;
};

/* Number of offsets below one; by bisection. */
static int64_t count_before(struct lines lines, int64_t offset)
{
    int64_t low = 0, high = lines.n;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (lines.offsets[middle] < offset)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Read one number of a corner in the line at `line`: its index from 0, and whether it has one. */
static inline bool read_index(
    struct text text, struct lines lines, int64_t line, int64_t *at, int64_t *index, int *fault)
{
    const bool backwards = *at < text.n && text.bytes[*at] == '-';
    *at += backwards;
    const int64_t first = *at;
    int64_t number = 0;
    for (; *at < text.n && text.bytes[*at] >= '0' && text.bytes[*at] <= '9'; ++*at)
        if (number < (int64_t)1 << 40) /* else it is out of range already */
            number = number * 10 + text.bytes[*at] - 48;
    if (*at == first) {
        if (backwards)
            *fault = BAD_CORNER;
        return false;
    }
    *index = backwards ? count_before(lines, line) - number : number - 1;
    if (*index < 0 || *index >= lines.n)
        *fault = OUT_OF_RANGE;
    return true;
}

/* Read a corner: its indices of v, vt and vn, -1 for none. Returns the place behind it. */
static inline int64_t read_corner(
    struct text text, const struct lines lines[3], int64_t line, int64_t at, int32_t corner[3])
{
    int fault = 0;
    corner[0] = corner[1] = corner[2] = -1;
    for (int part = 0; part < 3; part++) {
        int64_t index;
        if (read_index(text, lines[part], line, &at, &index, &fault))
            corner[part] = (int32_t)index;
        else if (part == 0)
            fault = BAD_CORNER;
        if (part == 2 || at >= text.n || text.bytes[at] != '/')
            break;
        at++;
    }
    if (at < text.n && is_in_word(text.bytes[at])) {
        fault = BAD_CORNER;
        at = skip_word(text, at);
    }
    if (fault < 0)
        corner[0] = fault;
    return at;
}

/* Read the corners of f lines start to stop - 1; v, vt and vn are the offsets of those lines. `ends`
   counts the corners up to each line. */
EXPORT void read_corners(
    int64_t n, int64_t n_rows, int64_t n_v, int64_t n_vt, int64_t n_vn, int64_t n_corners,
    const uint8_t bytes[n], const int64_t starts[n_rows], int64_t start, int64_t stop,
    const int64_t ends[n_rows], const int64_t v[n_v], const int64_t vt[n_vt], const int64_t vn[n_vn],
    int32_t corners[3][n_corners])
{
    const struct text text = {bytes, n};
    const struct lines lines[3] = {{n_v, v}, {n_vt, vt}, {n_vn, vn}};
    for (int64_t row = start; row < stop; row++) {
        int64_t at = starts[row];
        for (int64_t slot = row > 0 ? ends[row - 1] : 0; slot < ends[row]; slot++) {
            int32_t corner[3];
            at = read_corner(text, lines, starts[row], skip_blanks(text, at), corner);
            for (int part = 0; part < 3; part++)
                corners[part][slot] = corner[part];
        }
    }
}
