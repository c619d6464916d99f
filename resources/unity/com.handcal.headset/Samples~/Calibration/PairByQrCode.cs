#if HANDCAL_MSFT_QR
using System.Collections.Concurrent;
using Handcal;
using Microsoft.MixedReality.QR;
using UnityEngine;

/// <summary>
/// Pairs HoloLens 2 by the QR code that the PC shows. Needs the NuGet package
/// Microsoft.MixedReality.QR, the Webcam capability, and the define HANDCAL_MSFT_QR.
/// </summary>
public sealed class PairByQrCode : MonoBehaviour
{
    public HandcalHeadset headset;
    readonly ConcurrentQueue<string> seen = new ConcurrentQueue<string>();  // from another thread
    QRCodeWatcher watcher;

    async void Start()
    {
        if (await QRCodeWatcher.RequestAccessAsync() != QRCodeWatcherAccessStatus.Allowed) return;
        watcher = new QRCodeWatcher();
        watcher.Added += (_, code) => seen.Enqueue(code.Code.Data);
        watcher.Updated += (_, code) => seen.Enqueue(code.Code.Data);
        watcher.Start();
    }

    void Update()
    {
        while (seen.TryDequeue(out string text))
            if (headset.Pair(text)) enabled = false;
    }

    void OnDisable()
    {
        watcher?.Stop();
    }
}
#endif
