/* Reads calibration files from stdin, each behind its length (4 bytes, little-endian), and prints 1
 * for each that is accepted, 0 for each that is refused. */
#include "../views.h"

#include <stdio.h>
#include <stdlib.h>

int main(void) {
    unsigned char size[4];
    while (fread(size, 1, 4, stdin) == 4) {
        const size_t length = size[0] | size[1] << 8 | size[2] << 16;
        char *text = malloc(length ? length : 1); /* no byte more, for the sanitizer */
        HandcalCalibration found;
        if (!text || fread(text, 1, length, stdin) != length) return 1;
        putchar(handcal_read(text, length, &found) ? '0' : '1');
        free(text);
    }
    return 0;
}
