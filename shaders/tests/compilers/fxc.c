// Compiles a compute shader in HLSL with Microsoft's FXC, and prints the seconds of processor time that it took: fxc FILE ENTRY_POINT
#define COBJMACROS
#include <d3dcompiler.h>
#include <stdio.h>
#include <stdlib.h>

static char *content(const char *name, size_t *length) {
    FILE *file = fopen(name, "rb");
    if (!file) return NULL;
    fseek(file, 0, SEEK_END);
    *length = ftell(file);
    rewind(file);
    char *text = malloc(*length);
    *length = fread(text, 1, *length, file);
    fclose(file);
    return text;
}

// The processor's time, which other programs on the machine do not lengthen.
static double processor_seconds(void) {
    FILETIME begun, ended, kernel, user;
    GetProcessTimes(GetCurrentProcess(), &begun, &ended, &kernel, &user);
    return user.dwLowDateTime / 1e7 + user.dwHighDateTime * 429.4967296;
}

int main(int count, char **arguments) {
    size_t length = 0;
    char *text = count == 3 ? content(arguments[1], &length) : NULL;
    if (!text) return 2;
    ID3DBlob *code = NULL, *messages = NULL;
    double start = processor_seconds();
    // The flags and the shader model that wgpu passes.
    HRESULT result = D3DCompile(text, length, arguments[1], NULL, NULL, arguments[2], "cs_5_1",
                                D3DCOMPILE_ENABLE_STRICTNESS, 0, &code, &messages);
    if (FAILED(result)) {
        fprintf(stderr, "%s\n", messages ? (char *)ID3D10Blob_GetBufferPointer(messages) : "no message");
        return 1;
    }
    printf("%.2f\n", processor_seconds() - start);
    return 0;
}
