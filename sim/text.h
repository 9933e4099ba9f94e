// text: numbers and words into a string, whatever the locale is.
#ifndef CAIRN_SIM_TEXT_H
#define CAIRN_SIM_TEXT_H

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <string>

namespace sim
{

class Text
{
  public:
    Text &operator<<(const char *words)
    {
        content += words;
        return *this;
    }
    Text &operator<<(double number) // %.9g
    {
        return digits(number, 9);
    }
    Text &operator<<(int32_t number)
    {
        content += std::to_string(number);
        return *this;
    }
    Text &operator<<(uint64_t number)
    {
        content += std::to_string(number);
        return *this;
    }
    Text &digits(double number, int count) // %.<count>g
    {
        return convert(number, std::chars_format::general, count);
    }
    Text &fixed(double number, int decimals) // %.<decimals>f
    {
        return convert(number, std::chars_format::fixed, decimals);
    }
    int32_t write(FILE *file) const
    {
        return fwrite(content.data(), 1, content.size(), file) == content.size() &&
                       fflush(file) == 0
                   ? 0
                   : -1;
    }

  private:
    Text &convert(double number, std::chars_format format, int count)
    {
        char buffer[400];

        content.append(buffer,
                       std::to_chars(buffer, buffer + sizeof buffer, number, format, count).ptr);
        return *this;
    }
    std::string content;
};

} // namespace sim

#endif
