using Handcal;
using UnityEngine;

/// <summary>Asks for the text under the PC's QR code while the headset is not paired.</summary>
public sealed class PairByTyping : MonoBehaviour
{
    public HandcalHeadset headset;
    TouchScreenKeyboard keyboard;

    /// <summary>Opens the keyboard: call it from a button or a voice command.</summary>
    public void Ask()
    {
        keyboard = TouchScreenKeyboard.Open("HANDCAL://");
    }

    void Update()
    {
        if (keyboard == null || keyboard.status != TouchScreenKeyboard.Status.Done) return;
        if (headset.Pair(keyboard.text)) enabled = false;
        keyboard = null;
    }
}
